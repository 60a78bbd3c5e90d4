// Any bytes as a ROS message of each kind that a bag may hold: read or refused, never beyond the message's end.
#include <cstdint>
#include <cstdlib>
#include <span>
#include <vector>

#include "drivers/flights/recordings/ros_image.h"
#include "drivers/flights/recordings/ros_message.h"

using namespace epiline;

namespace {

// The pixels of an image lie in the message.
void expect_within(const std::optional<RosImage>& image, std::span<const std::uint8_t> message) {
  if (!image || image->data.empty()) return;
  if (image->data.data() < message.data() || image->data.size() > message.size()) std::abort();
  if (&image->data.back() > &message.back()) std::abort();
}

void read_as(RosEncoding encoding, std::span<const std::uint8_t> bytes) {
  const RosMessage message{encoding, bytes};
  (void)parse_stamp(message);
  (void)parse_imu(message);
  for (const char* type : {"geometry_msgs/PoseStamped", "geometry_msgs/TransformStamped", "nav_msgs/Odometry"})
    (void)parse_pose(type, message);
  const auto image = parse_image("sensor_msgs/Image", message);
  expect_within(image, bytes);
  // rows that fit: the last byte of the last row is there
  if (image && image->height > 0 && std::uint64_t{image->step} * image->height > image->data.size()) std::abort();
  expect_within(parse_image("sensor_msgs/CompressedImage", message), bytes);
  GreyImage grey;
  if (image) (void)to_grey(*image, grey);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::vector<std::uint8_t> message(data, data + size);  // of its own, so that reads beyond are found
  read_as(RosEncoding::kRos1, message);
  read_as(RosEncoding::kCdr, message);
  return 0;
}
