#pragma once
// Reads the messages of a flight from their serialised bytes. ROS 1: consecutive little-endian numbers, texts and
// arrays preceded by their length. ROS 2 (CDR): the same numbers behind four bytes that tell their order, each at a
// multiple of its size; texts end with a zero.
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "drivers/flights/recordings/byte_reader.h"
#include "pipeline/text/trajectory.h"
#include "platform/samples/samples.h"

namespace epiline {

enum class RosEncoding : std::uint8_t { kRos1, kCdr };

struct RosMessage {
  RosEncoding encoding;
  std::span<const std::uint8_t> bytes;
};

/// Reads values from the front of a message. After the first missing value, all further ones are missing too.
class RosReader {
 public:
  explicit RosReader(const RosMessage& message);
  bool good() const { return in_.good(); }
  std::uint8_t u8() { return number<std::uint8_t>(); }
  std::uint32_t u32() { return number<std::uint32_t>(); }
  double f64();
  std::string text();
  /// A block of bytes preceded by its length; not copied.
  std::span<const std::uint8_t> block() { return in_.take(u32()); }
  void skip_f64(std::size_t count);
  /// std_msgs/Header; its stamp.
  HostStamp header();

 private:
  template <class T>
  T number();
  void align(std::size_t size);

  ByteReader in_;  ///< of CDR without the four first
  std::size_t largest_align_ = 1;
  bool is_ros1_, big_endian_ = false;
};

/// sensor_msgs/Image or sensor_msgs/CompressedImage; the pixels stay in the message.
struct RosImage {
  HostStamp stamp;
  std::uint32_t width = 0, height = 0, step = 0;  ///< of Image alone
  std::string encoding;                           ///< of Image; the format of CompressedImage
  bool big_endian = false;
  std::span<const std::uint8_t> data;
};

/// Each fails if and only if the message ends too early, or an image's rows do not fit into its data.
std::optional<HostStamp> parse_stamp(const RosMessage& message);
/// `type`: sensor_msgs/Image or sensor_msgs/CompressedImage.
std::optional<RosImage> parse_image(const std::string& type, const RosMessage& message);
std::optional<ImuSample> parse_imu(const RosMessage& message);
/// `type`: geometry_msgs/PoseStamped, geometry_msgs/TransformStamped or nav_msgs/Odometry.
std::optional<TimedPose> parse_pose(const std::string& type, const RosMessage& message);

}  // namespace epiline
