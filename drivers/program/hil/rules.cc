#include "drivers/program/hil/rules.h"

#include <fmt/format.h>

namespace epiline::hil {

namespace {

constexpr bool kYes = true, kNo = false;
// In the order of Rule.
constexpr std::array<RuleInfo, kRules> kInfo{{
    {"fusion", "odometry that arrives and continues, as fusion needs it",
     "PX4 ekf2 ev_control.cpp; ArduPilot AP_VisualOdom.cpp", kYes, kYes},
    {"frames", "a pose in NED, ENU, FRD or FLU, and a velocity in one of them or BODY_FRD",
     "PX4 mavlink_receiver.cpp handle_message_odometry", kYes, kNo},
    {"frames LOCAL_FRD and BODY_FRD", "LOCAL_FRD and BODY_FRD; other frames are refused",
     "ArduPilot GCS_Common.cpp handle_odometry", kNo, kYes},
    {"estimator type", "estimator type unknown, vision or VIO; with naive, covariances are ignored",
     "PX4 mavlink_receiver.cpp handle_message_odometry", kYes, kNo},
    {"finite", "finite position, attitude and velocity, and a quaternion of length 1",
     "PX4 mavlink_receiver.cpp; ArduPilot AP_VisualOdom_MAV.cpp", kYes, kYes},
    {"covariance", "covariances that are known, positive, consistent, and below the controller's limits",
     "PX4 mavlink_receiver.cpp; ArduPilot AP_VisualOdom_MAV.cpp (100 m, 1.5 rad)", kYes, kYes},
    {"quality", "quality 1 to 100: gates refuse 0, and -1 means failed", "PX4 EKF2_EV_QMIN; ArduPilot VISO_QUAL_MIN",
     kYes, kYes},
    {"silence when lost", "no odometry while the estimate is lost: PX4 uses it even with quality -1",
     "PX4 params_external_vision.yaml EKF2_EV_QMIN", kYes, kYes},
    {"stamps rise", "time_usec later than in the previous message: no pose is sent twice",
     "PX4 ekf2 EKF2.cpp; ArduPilot GCS_Common.cpp (jitter correction)", kYes, kYes},
    {"rate", "a rate of 30 to 50 Hz", "PX4 manual, visual inertial odometry", kYes, kNo},
    {"flood", "at most 100 Hz: PX4 may drop samples above", "PX4 issue 10172", kYes, kNo},
    {"rate 4 Hz", "a rate of at least 4 Hz", "ArduPilot manual, non-GPS position estimation", kNo, kYes},
    {"gap 200 ms", "samples less than 200 ms apart: otherwise fusion does not start", "PX4 ekf2 ev_control.cpp", kYes,
     kNo},
    {"gap 400 ms", "no unannounced gap beyond 400 ms, after which fusion stops", "PX4 ekf2 ev_pos_control.cpp", kYes,
     kNo},
    {"gap 300 ms", "no unannounced gap beyond 300 ms, after which vision is unhealthy",
     "ArduPilot AP_VisualOdom_Backend.cpp", kNo, kYes},
    {"latency 300 ms", "arrival minus time_usec of 0 to 300 ms, once the clocks are known", "PX4 EKF2_EV_DELAY", kYes,
     kNo},
    {"latency 250 ms", "arrival minus time_usec of 0 to 250 ms", "ArduPilot VISO_DELAY_MS", kNo, kYes},
    {"timesync answers", "TIMESYNC answers within 10 ms, never six failures in a row", "PX4 mavlink_timesync.h", kYes,
     kNo},
    {"timesync converges", "clocks that are known after 500 exchanges, and stay known", "PX4 mavlink_timesync.h", kYes,
     kNo},
    {"heartbeat", "heartbeats at 1 Hz of an onboard controller without autopilot; 2.5 s without one is a lost link",
     "MAVLink heartbeat protocol; PX4 TelemetryStatus.msg", kYes, kYes},
    {"address", "all messages from the vehicle's system id and component 197 (visual inertial odometry)",
     "MAVLink MAV_COMPONENT", kYes, kYes},
    {"sequence", "consecutive sequence numbers: no message was lost", "MAVLink packet serialization", kYes, kYes},
    {"reset counter", "a reset counter that changes at each jump of the estimate, and only then",
     "PX4 ekf2 ev_pos_control.cpp", kYes, kYes},
    {"velocity", "a velocity that agrees with the change of position, in its frame", "PX4 ekf2 ev_vel_control.cpp",
     kYes, kYes},
    {"innovation", "innovations within 5 SD (position) and 3 SD (velocity)",
     "PX4 EKF2_EVP_GATE, EKF2_EVV_GATE, EKF2_EVP_NOISE, EKF2_EVV_NOISE", kYes, kNo},
    {"status text", "few texts, with at most 50 printable characters", "MAVLink STATUSTEXT", kYes, kYes},
    {"origin", "one origin on earth for a controller without GPS, always the same",
     "ArduPilot manual, non-GPS position estimation; GCS_Common.cpp handle_set_gps_global_origin", kNo, kYes},
    {"CAN frames", "frames with the right size and checksum, continuous alive counters, complete epochs", "docs/can.md",
     kYes, kYes},
    {"CAN status", "a status frame at least every 0.5 s, with the known layout version", "docs/can.md", kYes, kYes},
}};

std::string line_of(const RuleVerdict& v, HostStamp begin) {
  const RuleInfo& info = info_of(v.rule);
  const char* const who = info.px4 && info.ardupilot ? "both" : info.px4 ? "PX4" : "ArduPilot";
  std::string line = fmt::format("{:9} {:10} {}", kRuleStateNames[static_cast<int>(v.state)], who, info.name);
  if (!v.figure.empty()) line += ": " + v.figure;
  if (v.state != RuleState::kBroken) return line + "\n";
  return line + fmt::format("\n{:20} {} of {}, first after {:.2f} s: {}\n{:20} rule: {} [{}]\n", "", v.broken,
                            v.checked, (v.first_at - begin).seconds(), v.first, "", info.demand, info.source);
}

}  // namespace

const RuleInfo& info_of(Rule rule) { return kInfo[static_cast<std::size_t>(rule)]; }

bool Verdict::accepted_by(Controller controller) const {
  for (const RuleVerdict& v : rules)
    if (v.state == RuleState::kBroken && info_of(v.rule).asks(controller)) return false;
  return true;
}

std::vector<Rule> Verdict::broken() const {
  std::vector<Rule> list;
  for (const RuleVerdict& v : rules)
    if (v.state == RuleState::kBroken) list.push_back(v.rule);
  return list;
}

RuleBook::RuleBook() {
  for (std::size_t i = 0; i < kRules; ++i) verdict_.rules[i].rule = static_cast<Rule>(i);
}

Verdict RuleBook::verdict() const {
  Verdict verdict = verdict_;
  for (RuleVerdict& v : verdict.rules)
    v.state = v.broken > 0 ? RuleState::kBroken : v.checked > 0 ? RuleState::kKept : RuleState::kNotSeen;
  return verdict;
}

std::string text_of(const Verdict& verdict, HostStamp begin) {
  std::string text;
  for (const RuleState state : {RuleState::kBroken, RuleState::kKept, RuleState::kNotSeen})
    for (const RuleVerdict& v : verdict.rules)
      if (v.state == state) text += line_of(v, begin);
  for (const Controller c : {Controller::kPx4, Controller::kArdupilot})
    text += fmt::format("{} {} the odometry\n", kControllerNames[static_cast<int>(c)],
                        verdict.accepted_by(c) ? "accepts" : "REFUSES");
  return text;
}

}  // namespace epiline::hil
