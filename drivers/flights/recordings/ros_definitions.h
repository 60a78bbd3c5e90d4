#pragma once
#include <string>

namespace epiline {

/// The definition of a ROS 2 type that epiline writes (`sensor_msgs/Imu`) and of those in it, as a bag holds it.
std::string ros_definition(const std::string& type);

}  // namespace epiline
