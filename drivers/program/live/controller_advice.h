#pragma once
// Compares what a flight controller answered with what the odometry needs. Page: docs/flight-controller.md.
#include <string>
#include <vector>

#include "drivers/links/mavlink/controller_survey.h"
#include "drivers/links/mavlink/link.h"
#include "drivers/study/report/flight_record.h"
#include "pipeline/config/devices.h"

namespace epiline {

/// "PX4 1.17"; "PX4" if it did not say which.
std::string controller_name(const mavlink::ControllerAnswers& answers);

/// Parameters that do not suit the configured message and frame, each with its cure. Empty before the controller has
/// answered, or if all is well.
std::vector<DeviceAdvice> advice_of(const mavlink::ControllerAnswers& answers, const MavlinkConfig& config);

/// "PX4 1.17 answered: 12 parameters compared"; empty before it has answered.
std::string survey_note(const mavlink::ControllerAnswers& answers);

/// What the controller's filter takes from the odometry: "PX4 1.17 uses position and velocity, not height and yaw".
/// Empty while no odometry is sent, or the filter's answer is missing.
std::string use_of(const mavlink::LinkState& link, HostStamp now);

}  // namespace epiline
