#pragma once
// What a bag holds for a flight, read in one pass: all but the pixels.
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "drivers/flights/recordings/bag.h"
#include "drivers/flights/recordings/ros_message.h"

namespace epiline {

inline const std::vector<std::string> kImageTypes = {"sensor_msgs/Image", "sensor_msgs/CompressedImage"},
                                      kImuTypes = {"sensor_msgs/Imu"},
                                      kTruthTypes = {"geometry_msgs/PoseStamped", "geometry_msgs/TransformStamped",
                                                     "nav_msgs/Odometry"};

bool is_one_of(const std::vector<std::string>& types, const std::string& type);

/// What is said of a topic's message `index` that ends too early.
std::string cut_short_text(const BagTopic& topic, std::size_t index, const RosMessage& message);

/// One message of a topic: one of the three.
struct BagEntry {
  std::int64_t recorded_ns = 0;
  HostStamp stamp;
  BagPlace image;
  ImuSample imu;
  TimedPose pose;
};

struct TopicContent {
  BagTopic topic;
  RosEncoding encoding = RosEncoding::kRos1;
  std::string pixels;             ///< encoding of the first image
  std::vector<BagEntry> entries;  ///< in the order of recording
  std::string fault;              ///< of the first message that is incomplete; empty: none
};

struct BagContent {
  std::unique_ptr<Bag> bag;
  std::vector<TopicContent> topics;  ///< by name
};

/// Fails if and only if the bag cannot be opened or is damaged before its end.
Result<BagContent> read_bag(const std::filesystem::path& path);

/// Where no stamp of a header tells one message from the next, those of the recording take their place; true then.
bool mend_stamps(TopicContent& topic);
void use_recorded_stamps(TopicContent& topic);

/// Accelerometer's readings at the gyroscope's times, by straight lines between its own. Empty if they do not meet.
std::vector<BagEntry> joined_imu(const TopicContent& gyroscope, const TopicContent& accelerometer);
bool has_rates(const TopicContent& imu);
bool has_forces(const TopicContent& imu);

}  // namespace epiline
