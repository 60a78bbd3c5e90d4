#pragma once
// What came of an image, as messages of ROS 2: for MCAP files (docs/replay.md) and for live readers (docs/library.md).
#include <array>

#include "drivers/flights/recordings/cdr_writer.h"
#include "pipeline/stages/frame_outcome.h"

namespace epiline {

inline constexpr const char *kRosWorld = "odom", *kRosBody = "base_link";  // REP 105

// `stamp`: the image's, on the clock of the readers. These three need an outcome with a pose.

/// nav_msgs/Odometry
CdrWriter odometry_message(const FrameOutcome& outcome, HostStamp stamp);
/// geometry_msgs/PoseStamped
CdrWriter pose_message(const FrameOutcome& outcome, HostStamp stamp);
/// tf2_msgs/TFMessage
CdrWriter transform_message(const FrameOutcome& outcome, HostStamp stamp);

/// diagnostic_msgs/DiagnosticArray, with a pose or without.
CdrWriter diagnostics_message(const FrameOutcome& outcome, HostStamp stamp);

}  // namespace epiline
