#include "drivers/links/can/frames.h"

#include <cmath>
#include <limits>

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

/// w, x, y, z in place of which the three beside the largest are sent.
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
void set_deviations(Values& values, Quantity first, const std::array<float, 21>& triangle, std::size_t from) {
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

Values values_of(const Odometry& o, const mavlink::Odometry& m, HostStamp now) noexcept {
  Values values = values_of(o.health, m.reset_counter);
  const std::int64_t whole_us = o.stamp.ns / 1000;
  values[Quantity::kTime] = static_cast<double>(whole_us);
  values[Quantity::kAge] = (now - o.stamp).seconds();
  for (std::size_t i = 0; i < 3; ++i) values[after(Quantity::kPositionX, i)] = o.p_WB_m[i];
  // a turn of half a circle about x: right and down become left and up, on both sides of the quaternion
  const std::array<double, 4> q = {m.q[0], m.q[1], -m.q[2], -m.q[3]};
  for (std::size_t i = 0; i < 4; ++i) values[after(Quantity::kQuaternionW, i)] = q[i];
  set_smallest_three(values, q);
  values[Quantity::kVelocityX] = m.vx;
  values[Quantity::kVelocityY] = -m.vy;
  values[Quantity::kVelocityZ] = -m.vz;
  values[Quantity::kRateX] = m.rollspeed;
  values[Quantity::kRateY] = -m.pitchspeed;
  values[Quantity::kRateZ] = -m.yawspeed;
  set_deviations(values, Quantity::kPositionSdX, m.pose_covariance, 0);
  set_deviations(values, Quantity::kAttitudeSdX, m.pose_covariance, 3);
  set_deviations(values, Quantity::kVelocitySdX, m.velocity_covariance, 0);
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
    if (s.quantity != Quantity::kCrc) put_bits(data, s.start, s.length, raw_of(s, values[s.quantity]));
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
