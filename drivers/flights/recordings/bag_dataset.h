#pragma once
// A recorded flight in a bag: ROS 1, MCAP, ROS 2.
#include <filesystem>
#include <optional>
#include <string>

#include "drivers/flights/recordings/asl_dataset.h"
#include "drivers/flights/recordings/bag.h"

namespace epiline {

/// Topics of a bag to read; empty: the first one by name of a fitting type. Distances (depth) are no images unless they
/// are asked for.
struct BagTopics {
  std::string image;  ///< sensor_msgs/Image or CompressedImage
  std::string imu;    ///< sensor_msgs/Imu; gyroscope and accelerometer may be two topics
  std::string truth;  ///< geometry_msgs/PoseStamped, geometry_msgs/TransformStamped or nav_msgs/Odometry
};

/// Opens the bag and reads everything but the pixels. Stamps are those of the messages' headers; where these say
/// nothing, those of the recording, with a note. A bag has no calibration: `camera_file` (looked up as `camera` in a
/// Kalibr chain) and `imu_file` are required. Fails if and only if a calibration is missing or wrong, the file is not a
/// bag or is damaged before its end, a topic is missing or has the wrong type, or a message is truncated.
Result<AslDataset> open_bag_dataset(const std::filesystem::path& bag, const BagTopics& topics,
                                    const std::string& camera, const std::filesystem::path& camera_file,
                                    const std::filesystem::path& imu_file);

}  // namespace epiline
