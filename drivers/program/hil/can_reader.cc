#include "drivers/program/hil/can_reader.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "drivers/program/hil/vision_sample.h"

namespace epiline::hil {

namespace {

using can::Quantity;

constexpr Span kStatusMost = Span::from_milliseconds(500);  // later, bus or computer are taken for gone
constexpr std::size_t kFirstClassic = 1, kLastClassic = 6, kLastDeviation = 9, kFd = 10;
constexpr std::uint32_t kWholeEpoch = (1U << (kLastClassic + 1)) - (1U << kFirstClassic);
constexpr int kTracking = 1, kDegraded = 2;

/// This reader judges frames that drivers/links/can/bits.h packed, so it unpacks them by itself: a mistake in shared
/// code would undo itself.
std::uint64_t bits_of(const can::Frame& frame, const can::Signal& signal) {
  std::uint64_t raw = 0;
  for (int i = signal.length - 1; i >= 0; --i) {
    const int bit = signal.start + i;
    raw = raw << 1U | (frame.data[static_cast<std::size_t>(bit / 8)] >> (bit % 8) & 1U);
  }
  return raw;
}

double value_of(const can::Frame& frame, const can::Signal& signal) {
  const std::uint64_t raw = bits_of(frame, signal), top = std::uint64_t{1} << (signal.length - 1);
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  switch (signal.coding) {
    case can::Coding::kCounter:
      return static_cast<double>(raw) * signal.scale;
    case can::Coding::kUnsigned:
      return raw == 2 * top - 1 ? kNaN : static_cast<double>(raw) * signal.scale;
    case can::Coding::kSigned:
      if (raw == top) return kNaN;
      return (static_cast<double>(raw) - (raw > top ? 2 * static_cast<double>(top) : 0)) * signal.scale;
  }
  return kNaN;
}

/// CRC-8 of SAE J1850, bit by bit as its standard has it.
std::uint8_t crc_of(const can::Frame& frame) {
  std::uint8_t crc = 0xff;
  const auto add = [&](std::uint8_t byte) {
    crc ^= byte;
    for (int i = 0; i < 8; ++i) crc = static_cast<std::uint8_t>((crc & 0x80U) != 0 ? crc << 1U ^ 0x1dU : crc << 1U);
  };
  add(static_cast<std::uint8_t>(frame.id));
  add(static_cast<std::uint8_t>(frame.id >> 8U));
  for (std::size_t i = 1; i < frame.size; ++i) add(frame.data[i]);
  return static_cast<std::uint8_t>(crc ^ 0xffU);
}

/// -1: not available.
int whole(double value) { return std::isfinite(value) ? static_cast<int>(value) : -1; }

Eigen::Quaternionf attitude_of(const can::Values& v, bool fd) {
  std::array<double, 4> q{};
  if (fd) {
    q = {v[Quantity::kQuaternionW], v[Quantity::kQuaternionX], v[Quantity::kQuaternionY], v[Quantity::kQuaternionZ]};
  } else {
    const std::array three = {v[Quantity::kSmallestThreeA], v[Quantity::kSmallestThreeB], v[Quantity::kSmallestThreeC]};
    const auto largest = static_cast<std::size_t>(v[Quantity::kSmallestThreeLargest]) % 4;
    double sum = 0;
    for (std::size_t i = 0, next = 0; i < 4; ++i) {
      if (i == largest) continue;
      q[i] = three[next++];
      sum += q[i] * q[i];
    }
    q[largest] = std::sqrt(std::max(0.0, 1 - sum));
  }
  const Eigen::Quaterniond attitude(q[0], q[1], q[2], q[3]);
  return attitude.normalized().cast<float>();  // zeros stay zeros
}

}  // namespace

std::optional<mavlink::Odometry> CanReader::take(const can::Frame& frame, HostStamp arrival, RuleBook& book) {
  const int number = static_cast<int>(frame.id) - base_id_;
  if (number < 0 || number >= static_cast<int>(can::kMessages.size())) return std::nullopt;  // another's
  const auto n = static_cast<std::size_t>(number);
  if (!judge_frame(frame, n, arrival, book)) return std::nullopt;
  for (const can::Signal& signal : can::kMessages[n].signals) values_[signal.quantity] = value_of(frame, signal);
  if (n == 0) judge_status(arrival, book);
  if (n == kLastDeviation) deviations_known_ = true;
  if (n == kFd && deviations_known_) return odometry(true);
  if (n >= kFirstClassic && n <= kLastClassic && completes_epoch(n, arrival, book) && deviations_known_)
    return odometry(false);
  return std::nullopt;
}

bool CanReader::judge_frame(const can::Frame& frame, std::size_t n, HostStamp arrival, RuleBook& book) {
  const can::Message& message = can::kMessages[n];
  const bool whole = book.judge(Rule::kCanFrames, frame.size == message.size && crc_of(frame) == frame.data[0], arrival,
                                [&] { return fmt::format("{}: {} bytes, wrong checksum", message.name, frame.size); });
  if (!whole) return false;
  const auto alive = static_cast<std::uint8_t>(bits_of(frame, can::kAlive));
  if (alive_[n]) {
    book.judge(Rule::kCanFrames, alive == ((*alive_[n] + 1) & 0xf), arrival,
               [&] { return fmt::format("{}: number {} after {}", message.name, alive, *alive_[n]); });
  }
  alive_[n] = alive;
  return true;
}

/// Classic frames of one instant belong together.
bool CanReader::completes_epoch(std::size_t n, HostStamp arrival, RuleBook& book) {
  const auto epoch = static_cast<std::uint8_t>(values_[Quantity::kEpoch]);
  if (epoch_ != epoch) {
    if (epoch_) {
      book.judge(Rule::kCanFrames, have_ == kWholeEpoch, arrival,
                 [&] { return fmt::format("epoch {} was not complete", *epoch_); });
    }
    epoch_ = epoch;
    have_ = 0;
  }
  have_ |= 1U << n;
  return have_ == kWholeEpoch;
}

void CanReader::judge_status(HostStamp arrival, RuleBook& book) {
  const int state = whole(values_[Quantity::kState]), version = whole(values_[Quantity::kVersion]);
  says_silence_ = state != kTracking && state != kDegraded;
  book.judge(Rule::kCanStatus, version == can::kLayoutVersion, arrival,
             [&] { return fmt::format("layout version {}", version); });
  if (newest_status_) {
    book.judge(Rule::kCanStatus, arrival - *newest_status_ <= kStatusMost, arrival,
               [&] { return fmt::format("{:.2f} s without status", (arrival - *newest_status_).seconds()); });
  }
  newest_status_ = arrival;
}

void CanReader::finish(HostStamp end, RuleBook& book) {
  book.judge(Rule::kCanStatus, newest_status_ && end - *newest_status_ <= kStatusMost, end,
             [] { return std::string("no status at the end"); });
}

/// From forward, left, up to forward, right, down.
mavlink::Odometry CanReader::odometry(bool fd) const {
  const can::Values& v = values_;
  const auto number = [&](Quantity q) { return static_cast<float>(v[q]); };
  const auto frd = [&](Quantity x) { return std::tuple(number(x), -number(after(x, 1)), -number(after(x, 2))); };
  mavlink::Odometry m;
  m.time_usec = std::isfinite(v[Quantity::kTime]) ? static_cast<std::uint64_t>(v[Quantity::kTime]) : ~std::uint64_t{0};
  std::tie(m.x, m.y, m.z) = frd(Quantity::kPositionX);
  const Eigen::Quaternionf q = attitude_of(v, fd);
  m.q = {q.w(), q.x(), -q.y(), -q.z()};
  std::tie(m.vx, m.vy, m.vz) = frd(Quantity::kVelocityX);
  std::tie(m.rollspeed, m.pitchspeed, m.yawspeed) = frd(Quantity::kRateX);
  const auto variance = [&](Quantity sd) { return number(sd) * number(sd); };
  for (std::size_t i = 0; i < 3; ++i) {
    m.pose_covariance[kDiagonal[i]] = variance(after(Quantity::kPositionSdX, i));
    m.pose_covariance[kDiagonal[3 + i]] = variance(after(Quantity::kAttitudeSdX, i));
    m.velocity_covariance[kDiagonal[i]] = variance(after(Quantity::kVelocitySdX, i));
    m.velocity_covariance[kDiagonal[3 + i]] = 1e-4F;  // of the rates: the bus does not say
  }
  m.reset_counter = static_cast<std::uint8_t>(v[Quantity::kResetCounter]);
  m.quality = std::isfinite(v[Quantity::kQuality]) ? static_cast<std::int8_t>(std::min(v[Quantity::kQuality], 127.0))
                                                   : std::int8_t{0};
  return m;
}

}  // namespace epiline::hil
