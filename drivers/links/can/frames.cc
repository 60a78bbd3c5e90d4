#include "drivers/links/can/frames.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "drivers/links/stream/vehicle_odometry.h"

namespace epiline::can {

namespace {

constexpr std::array<std::uint8_t, 256> crc_table() {
  std::array<std::uint8_t, 256> table{};
  for (std::size_t i = 0; i < table.size(); ++i) {
    auto crc = static_cast<std::uint8_t>(i);
    for (int bit = 0; bit < 8; ++bit) crc = static_cast<std::uint8_t>((crc & 0x80) != 0 ? crc << 1 ^ 0x1d : crc << 1);
    table[i] = crc;
  }
  return table;
}
constexpr auto kCrcTable = crc_table();

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

/// Sends the three smallest of w, x, y, z; the receiver computes the largest.
void set_smallest_three(Values& values, const std::array<double, 4>& q) {
  std::size_t largest = 0;
  double norm = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    if (std::abs(q[i]) > std::abs(q[largest])) largest = i;
    norm += q[i] * q[i];
  }
  const double scale = (q[largest] < 0 ? -1 : 1) / std::sqrt(norm);  // not a number where there is no rotation
  values[Quantity::kSmallestThreeLargest] = static_cast<double>(largest);
  std::size_t at = 0;
  for (std::size_t i = 0; i < 4; ++i)
    if (i != largest) values[after(Quantity::kSmallestThreeA, at++)] = scale * q[i];
}

/// Square roots of the diagonal of a 6x6 upper triangle. An unknown one begins with something that is no number.
void set_deviations(Values& values, Quantity first, const Covariance6& triangle, std::size_t from) {
  constexpr std::array<std::size_t, 6> kDiagonal = {0, 6, 11, 15, 18, 20};
  for (std::size_t i = 0; i < 3; ++i) {
    const double variance = std::isnan(triangle[0]) ? kUnknown : static_cast<double>(triangle[kDiagonal[from + i]]);
    values[after(first, i)] = std::sqrt(variance);  // a negative one is no variance: unknown
  }
}

}  // namespace

std::uint8_t crc_of(std::uint16_t id, std::span<const std::uint8_t> data) noexcept {
  std::uint8_t crc = 0xff;
  crc = kCrcTable[crc ^ (id & 0xff)];
  crc = kCrcTable[crc ^ (id >> 8)];
  for (const std::uint8_t byte : data.subspan(1)) crc = kCrcTable[crc ^ byte];
  return crc ^ 0xff;
}

Values values_of(const Health& health, std::uint8_t reset_counter) noexcept {
  Values values;
  values[Quantity::kState] = static_cast<double>(health.state);
  values[Quantity::kQuality] = health.quality < 0 ? kUnknown : health.quality;
  values[Quantity::kReasons] = health.reasons;
  values[Quantity::kResetCounter] = reset_counter;
  return values;
}

Values values_of(const Odometry& o, const Mat3& R_VB, std::uint8_t reset_counter, HostStamp now) noexcept {
  const VehicleOdometry vehicle = in_vehicle_axes(o, R_VB);
  Values values = values_of(o.health, reset_counter);
  const std::int64_t whole_us = o.stamp.ns / 1000;
  values[Quantity::kTime] = static_cast<double>(whole_us);
  values[Quantity::kAge] = (now - o.stamp).seconds();
  for (std::size_t i = 0; i < 3; ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    values[after(Quantity::kPositionX, i)] = o.p_WB_m[i];
    values[after(Quantity::kVelocityX, i)] = static_cast<double>(vehicle.v_V_m_s[axis]);
    values[after(Quantity::kRateX, i)] = static_cast<double>(vehicle.omega_V_rad_s[axis]);
  }
  std::array<double, 4> q{};
  std::copy(vehicle.q_WV.begin(), vehicle.q_WV.end(), q.begin());
  for (std::size_t i = 0; i < 4; ++i) values[after(Quantity::kQuaternionW, i)] = q[i];
  set_smallest_three(values, q);
  set_deviations(values, Quantity::kPositionSdX, vehicle.pose_covariance, 0);
  set_deviations(values, Quantity::kAttitudeSdX, vehicle.pose_covariance, 3);
  set_deviations(values, Quantity::kVelocitySdX, vehicle.velocity_covariance, 0);
  return values;
}

Frame FrameWriter::pack(const Message& message, Values& values) noexcept {
  Frame frame;
  frame.id = static_cast<std::uint16_t>(base_id_ + message.id_offset);
  frame.size = message.size;
  const std::span<std::uint8_t> data(frame.data.data(), frame.size);
  values[Quantity::kEpoch] = epoch_;
  values[Quantity::kAlive] = alive_[message.id_offset]++;
  values[Quantity::kVersion] = kLayoutVersion;
  for (const Signal& s : message.signals)
    if (s.quantity != Quantity::kCrc) put_bits(data, s.bits(), raw_of(s, values[s.quantity]));
  data[0] = crc_of(frame.id, data);
  return frame;
}

Frames FrameWriter::odometry(Values values, bool deviations) noexcept {
  ++epoch_;
  Frames frames;
  if (fd_) {
    frames.push_back(pack(kFdOdometry, values));
  } else {
    for (const Message& m : kClassicOdometry) frames.push_back(pack(m, values));
  }
  if (deviations)
    for (const Message& m : kDeviations) frames.push_back(pack(m, values));
  return frames;
}

Frame FrameWriter::status(Values values) noexcept { return pack(kStatus, values); }

}  // namespace epiline::can
