#include "drivers/flights/recordings/ros_message.h"

#include <algorithm>
#include <bit>

namespace epiline {

RosReader::RosReader(const RosMessage& message) : in_(message.bytes), is_ros1_(message.encoding == RosEncoding::kRos1) {
  if (is_ros1_) return;
  constexpr std::uint8_t kCdr = 0, kCdr2 = 6;  // and one more for little-endian
  const auto head = in_.take(4);
  if (head.empty()) return;
  const auto kind = static_cast<std::uint8_t>(head[1] & ~1U);
  big_endian_ = (head[1] & 1U) == 0;
  largest_align_ = kind == kCdr ? 8 : 4;
  in_ = ByteReader(message.bytes.subspan(4));
  if (head[0] != 0 || (kind != kCdr && kind != kCdr2)) in_.fail();
}

void RosReader::align(std::size_t size) {
  const std::size_t to = std::min(size, largest_align_);
  in_.take((to - in_.at() % to) % to);
}

template <class T>
T RosReader::number() {
  align(sizeof(T));
  const auto bytes = in_.take(sizeof(T));
  T value = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    const std::size_t place = big_endian_ ? sizeof(T) - 1 - i : i;
    value = static_cast<T>(value | (static_cast<T>(bytes[i]) << (8 * place)));
  }
  return value;
}

void RosReader::skip_f64(std::size_t count) {
  align(sizeof(double));
  in_.take(count * sizeof(double));
}

double RosReader::f64() { return std::bit_cast<double>(number<std::uint64_t>()); }

std::string RosReader::text() {
  const auto bytes = block();
  const bool has_zero = !is_ros1_ && !bytes.empty() && bytes.back() == 0;
  return {bytes.begin(), bytes.end() - (has_zero ? 1 : 0)};
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

std::optional<RosImage> parse_image(const std::string& type, const RosMessage& message) {
  const bool is_raw = type == "sensor_msgs/Image";
  RosReader in(message);
  RosImage image;
  image.stamp = in.header();
  if (is_raw) image.height = in.u32();
  if (is_raw) image.width = in.u32();
  image.encoding = in.text();
  if (is_raw) image.big_endian = in.u8() != 0;
  if (is_raw) image.step = in.u32();
  image.data = in.block();
  const bool fits = std::uint64_t{image.step} * image.height <= image.data.size();
  return in.good() && fits ? std::optional(image) : std::nullopt;
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
