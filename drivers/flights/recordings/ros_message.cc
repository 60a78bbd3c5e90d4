#include "drivers/flights/recordings/ros_message.h"

#include <bit>
#include <tuple>

namespace epiline {

const std::uint8_t* RosReader::take(std::size_t bytes) {
  good_ = good_ && bytes <= left_;
  if (!good_) return nullptr;
  const std::uint8_t* at = next_;
  next_ += bytes;
  left_ -= bytes;
  return at;
}

template <class T>
T RosReader::number() {
  const std::uint8_t* at = take(sizeof(T));
  T value = 0;
  for (std::size_t i = 0; at && i < sizeof(T); ++i) value = static_cast<T>(value | (static_cast<T>(at[i]) << (8 * i)));
  return value;
}

double RosReader::f64() { return std::bit_cast<double>(number<std::uint64_t>()); }

std::pair<const std::uint8_t*, std::size_t> RosReader::block() {
  const std::size_t size = u32();
  const std::uint8_t* at = take(size);
  return {at, at ? size : 0};
}

std::string RosReader::text() {
  const auto [at, size] = block();
  return at ? std::string(reinterpret_cast<const char*>(at), size) : std::string();
}

HostStamp RosReader::header() {
  u32();  // sequence number
  const std::int64_t seconds = u32(), nanoseconds = u32();
  text();  // frame
  return HostStamp{seconds * 1'000'000'000 + nanoseconds};
}

std::optional<HostStamp> parse_stamp(const std::vector<std::uint8_t>& message) {
  RosReader in(message.data(), message.size());
  const HostStamp stamp = in.header();
  return in.good() ? std::optional(stamp) : std::nullopt;
}

std::optional<RosImage> parse_image(const std::vector<std::uint8_t>& message) {
  RosReader in(message.data(), message.size());
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

std::optional<RosImage> parse_compressed_image(const std::vector<std::uint8_t>& message) {
  RosReader in(message.data(), message.size());
  RosImage image;
  image.stamp = in.header();
  image.encoding = in.text();
  std::tie(image.data, image.size) = in.block();
  return in.good() ? std::optional(image) : std::nullopt;
}

std::optional<ImuSample> parse_imu(const std::vector<std::uint8_t>& message) {
  constexpr std::size_t kOrientation = 4 * 8, kCovariance = 9 * 8;
  RosReader in(message.data(), message.size());
  ImuSample sample;
  sample.stamp = in.header();
  in.skip(kOrientation + kCovariance);
  for (double& rate : sample.angular_velocity_rad_s) rate = in.f64();
  in.skip(kCovariance);
  for (double& force : sample.specific_force_m_s2) force = in.f64();
  in.skip(kCovariance);
  return in.good() ? std::optional(sample) : std::nullopt;
}

std::optional<TimedPose> parse_pose(const std::string& type, const std::vector<std::uint8_t>& message) {
  RosReader in(message.data(), message.size());
  TimedPose pose;
  pose.stamp = in.header();
  if (type != "geometry_msgs/PoseStamped") in.text();  // the child frame
  for (int i = 0; i < 3; ++i) pose.p_WB[i] = in.f64();
  for (int i = 0; i < 4; ++i) pose.q_WB.coeffs()[i] = in.f64();  // x y z w, as Eigen keeps them
  return in.good() ? std::optional(pose) : std::nullopt;
}

}  // namespace epiline
