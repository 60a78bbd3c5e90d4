#pragma once
// Reads the ROS 1 messages of a flight from their serialised bytes: consecutive little-endian numbers, texts and arrays
// preceded by their length.
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/text/trajectory.h"
#include "platform/samples/samples.h"

namespace epiline {

/// Reads values from the front of a message. After the first missing value, all further ones are missing too.
class RosReader {
 public:
  RosReader(const std::uint8_t* bytes, std::size_t size) : next_(bytes), left_(size) {}
  bool good() const { return good_; }
  std::uint8_t u8() { return number<std::uint8_t>(); }
  std::uint32_t u32() { return number<std::uint32_t>(); }
  double f64();
  std::string text();
  /// A block of bytes preceded by its length; not copied.
  std::pair<const std::uint8_t*, std::size_t> block();
  void skip(std::size_t bytes) { take(bytes); }
  /// std_msgs/Header; its stamp.
  HostStamp header();

 private:
  template <class T>
  T number();
  const std::uint8_t* take(std::size_t bytes);

  const std::uint8_t* next_;
  std::size_t left_;
  bool good_ = true;
};

/// sensor_msgs/Image or sensor_msgs/CompressedImage; the pixels stay in the message.
struct RosImage {
  HostStamp stamp;
  std::uint32_t width = 0, height = 0, step = 0;  ///< of Image alone
  std::string encoding;                           ///< of Image; the format of CompressedImage
  bool big_endian = false;
  const std::uint8_t* data = nullptr;
  std::size_t size = 0;
};

/// Each fails if and only if the message ends too early, or an image's rows do not fit into its data.
std::optional<HostStamp> parse_stamp(const std::vector<std::uint8_t>& message);
std::optional<RosImage> parse_image(const std::vector<std::uint8_t>& message);
std::optional<RosImage> parse_compressed_image(const std::vector<std::uint8_t>& message);
std::optional<ImuSample> parse_imu(const std::vector<std::uint8_t>& message);
/// `type`: geometry_msgs/PoseStamped, geometry_msgs/TransformStamped or nav_msgs/Odometry.
std::optional<TimedPose> parse_pose(const std::string& type, const std::vector<std::uint8_t>& message);

}  // namespace epiline
