#include "drivers/flights/recordings/ros_message.h"

#include <algorithm>
#include <bit>
#include <tuple>

namespace epiline {

RosReader::RosReader(const RosMessage& message)
    : bytes_(message.bytes), is_ros1_(message.encoding == RosEncoding::kRos1) {
  if (is_ros1_) return;
  constexpr std::uint8_t kCdr = 0, kCdr2 = 6;  // and one more for little-endian
  const std::uint8_t* head = take(4);
  if (head == nullptr) return;
  const auto kind = static_cast<std::uint8_t>(head[1] & ~1U);
  good_ = head[0] == 0 && (kind == kCdr || kind == kCdr2);
  big_endian_ = (head[1] & 1U) == 0;
  largest_align_ = kind == kCdr ? 8 : 4;
  bytes_ = bytes_.subspan(4);
  at_ = 0;
}

const std::uint8_t* RosReader::take(std::size_t bytes) {
  good_ = good_ && bytes <= bytes_.size() - at_;
  if (!good_) return nullptr;
  at_ += bytes;
  return bytes_.data() + at_ - bytes;
}

void RosReader::align(std::size_t size) {
  const std::size_t to = std::min(size, largest_align_);
  take((to - at_ % to) % to);
}

template <class T>
T RosReader::number() {
  align(sizeof(T));
  const std::uint8_t* at = take(sizeof(T));
  T value = 0;
  for (std::size_t i = 0; at && i < sizeof(T); ++i) {
    const std::size_t place = big_endian_ ? sizeof(T) - 1 - i : i;
    value = static_cast<T>(value | (static_cast<T>(at[i]) << (8 * place)));
  }
  return value;
}

void RosReader::skip_f64(std::size_t count) {
  align(sizeof(double));
  take(count * sizeof(double));
}

double RosReader::f64() { return std::bit_cast<double>(number<std::uint64_t>()); }

std::pair<const std::uint8_t*, std::size_t> RosReader::block() {
  const std::size_t size = u32();
  const std::uint8_t* at = take(size);
  return {at, at ? size : 0};
}

std::string RosReader::text() {
  const auto [at, size] = block();
  if (size == 0) return {};
  const bool has_zero = !is_ros1_ && at[size - 1] == 0;
  return {reinterpret_cast<const char*>(at), size - (has_zero ? 1 : 0)};
}

HostStamp RosReader::header() {
  if (is_ros1_) u32();  // sequence number
  const std::uint32_t whole = u32();
  const std::int64_t seconds = is_ros1_ ? std::int64_t{whole} : std::int64_t{static_cast<std::int32_t>(whole)},
                     nanoseconds = u32();
  text();  // frame
  return HostStamp{seconds * 1'000'000'000 + nanoseconds};
}

std::optional<HostStamp> parse_stamp(const RosMessage& message) {
  RosReader in(message);
  const HostStamp stamp = in.header();
  return in.good() ? std::optional(stamp) : std::nullopt;
}

std::optional<RosImage> parse_image(const RosMessage& message) {
  RosReader in(message);
  RosImage image;
  image.stamp = in.header();
  image.height = in.u32();
  image.width = in.u32();
  image.encoding = in.text();
  image.big_endian = in.u8() != 0;
  image.step = in.u32();
  std::tie(image.data, image.size) = in.block();
  const bool fits = std::uint64_t{image.step} * image.height <= image.size;
  return in.good() && fits ? std::optional(image) : std::nullopt;
}

std::optional<RosImage> parse_compressed_image(const RosMessage& message) {
  RosReader in(message);
  RosImage image;
  image.stamp = in.header();
  image.encoding = in.text();
  std::tie(image.data, image.size) = in.block();
  return in.good() ? std::optional(image) : std::nullopt;
}

std::optional<ImuSample> parse_imu(const RosMessage& message) {
  constexpr std::size_t kOrientation = 4, kCovariance = 9;
  RosReader in(message);
  ImuSample sample;
  sample.stamp = in.header();
  in.skip_f64(kOrientation + kCovariance);
  for (double& rate : sample.angular_velocity_rad_s) rate = in.f64();
  in.skip_f64(kCovariance);
  for (double& force : sample.specific_force_m_s2) force = in.f64();
  in.skip_f64(kCovariance);
  return in.good() ? std::optional(sample) : std::nullopt;
}

std::optional<TimedPose> parse_pose(const std::string& type, const RosMessage& message) {
  RosReader in(message);
  TimedPose pose;
  pose.stamp = in.header();
  if (type != "geometry_msgs/PoseStamped") in.text();  // the child frame
  for (int i = 0; i < 3; ++i) pose.p_WB[i] = in.f64();
  for (int i = 0; i < 4; ++i) pose.q_WB.coeffs()[i] = in.f64();  // x y z w, as Eigen keeps them
  return in.good() ? std::optional(pose) : std::nullopt;
}

}  // namespace epiline
