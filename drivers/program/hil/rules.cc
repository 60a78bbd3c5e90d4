#include "drivers/program/hil/rules.h"

#include <fmt/format.h>

namespace epiline::hil {

namespace {

// In the order of Rule.
constexpr std::array<RuleInfo, kRules> kInfo{{
    {"fusion", "odometry that arrives and continues, as fusion needs it",
     "PX4 ekf2 ev_control.cpp; ArduPilot AP_VisualOdom.cpp", kEveryRelease},
    {"frames", "a pose in NED, ENU, FRD or FLU, and a velocity in one of them or BODY_FRD",
     "PX4 mavlink_receiver.cpp handle_message_odometry", kEveryPx4},
    {"frames LOCAL_FRD and BODY_FRD", "LOCAL_FRD and BODY_FRD; other frames are refused",
     "ArduPilot GCS_Common.cpp handle_odometry", kEveryArdupilot},
    {"estimator type", "estimator type unknown, vision or VIO; with naive, covariances are ignored",
     "PX4 mavlink_receiver.cpp handle_message_odometry", kEveryPx4},
    {"finite", "finite position, attitude and velocity, and a quaternion of length 1",
     "PX4 mavlink_receiver.cpp; ArduPilot AP_VisualOdom_MAV.cpp", kEveryRelease},
    {"covariance", "covariances that are known, positive, consistent, and below the controller's limits",
     "PX4 mavlink_receiver.cpp; ArduPilot AP_VisualOdom_MAV.cpp (100 m, 1.5 rad)", kEveryRelease},
    {"quality", "quality 1 to 100: gates refuse 0, and -1 means failed", "PX4 EKF2_EV_QMIN; ArduPilot VISO_QUAL_MIN",
     kEveryRelease},
    {"silence when lost", "no odometry while the estimate is lost: PX4 uses it even with quality -1",
     "PX4 params_external_vision.yaml EKF2_EV_QMIN", kEveryRelease},
    {"stamps rise", "time_usec later than in the previous message: no pose is sent twice",
     "PX4 ekf2 EKF2.cpp; ArduPilot GCS_Common.cpp (jitter correction)", kEveryRelease},
    {"rate", "a rate of 30 to 50 Hz", "PX4 manual, visual inertial odometry", kEveryPx4},
    {"flood", "at most 100 Hz: PX4 may drop samples above", "PX4 issue 10172", kEveryPx4},
    {"rate 4 Hz", "a rate of at least 4 Hz", "ArduPilot manual, non-GPS position estimation", kEveryArdupilot},
    {"gap 200 ms", "samples less than 200 ms apart: otherwise fusion does not start", "PX4 ekf2 ev_control.cpp",
     kEveryPx4},
    {"gap 400 ms", "no unannounced gap beyond 400 ms, after which fusion stops", "PX4 ekf2 ev_pos_control.cpp",
     kEveryPx4},
    {"gap 300 ms", "no unannounced gap beyond 300 ms, after which vision is unhealthy",
     "ArduPilot AP_VisualOdom_Backend.cpp", kEveryArdupilot},
    {"latency 200 ms", "arrival minus time_usec of 0 to 200 ms, once the clocks are known", "PX4 EKF2_DELAY_MAX",
     kEveryPx4},
    {"latency 250 ms", "arrival minus time_usec of 0 to 250 ms", "ArduPilot VISO_DELAY_MS", kEveryArdupilot},
    {"timesync answers", "TIMESYNC answers within 10 ms, never six failures in a row", "PX4 mavlink_timesync.h",
     kEveryPx4},
    {"timesync converges", "clocks that are known after 500 exchanges, and stay known", "PX4 mavlink_timesync.h",
     kEveryPx4},
    {"heartbeat", "heartbeats at 1 Hz of an onboard controller without autopilot; 2.5 s without one is a lost link",
     "MAVLink heartbeat protocol; PX4 TelemetryStatus.msg", kEveryRelease},
    {"address", "all messages from the vehicle's system id and component 197 (visual inertial odometry)",
     "MAVLink MAV_COMPONENT", kEveryRelease},
    {"sequence", "consecutive sequence numbers: no message was lost", "MAVLink packet serialization", kEveryRelease},
    {"reset counter", "a reset counter that changes at each jump of the estimate, and only then",
     "PX4 ekf2 ev_pos_control.cpp", kEveryRelease},
    {"velocity", "a velocity that agrees with the change of position, in its frame", "PX4 ekf2 ev_vel_control.cpp",
     kEveryRelease},
    {"innovation", "innovations within 5 SD (position) and 3 SD (velocity)",
     "PX4 EKF2_EVP_GATE, EKF2_EVV_GATE, EKF2_EVP_NOISE, EKF2_EVV_NOISE", kEveryPx4},
    {"arming", "poses in LOCAL_NED: without a heading reference these builds do not arm in Position mode",
     "PX4 pull requests 26596, 26778, 27215; relaxed by 27371", kPx4Spring2026},
    {"turn 33 degrees",
     "after a gap in LOCAL_NED, a heading within 2.6 SD of PX4's: it fuses yaw, and does not reset it",
     "PX4 ekf2 ev_yaw_control.cpp; EKF2_HDG_GATE, EKF2_EVA_NOISE 0.05 taken as a variance", kPx4Before27342},
    {"turn 15 degrees",
     "after a gap in LOCAL_NED, a heading within 2.6 SD of PX4's: it fuses yaw, and does not reset it",
     "PX4 ekf2 ev_yaw_control.cpp; EKF2_HDG_GATE, EKF2_EVA_NOISE 0.1", kPx4Since27342},
    {"turn 34 degrees",
     "after a reset, a heading within 3 SD of ArduPilot's, which with VISO_TYPE 1 does not follow it",
     "ArduPilot EK3_YAW_I_GATE, VISO_YAW_M_NSE", kEveryArdupilot},
    {"status text", "few texts, with at most 50 printable characters", "MAVLink STATUSTEXT", kEveryRelease},
    {"origin", "one origin on earth for a controller without GPS, always the same",
     "ArduPilot manual, non-GPS position estimation; GCS_Common.cpp handle_set_gps_global_origin", kEveryArdupilot},
    {"CAN frames", "frames with the right size and checksum, continuous alive counters, complete epochs", "docs/can.md",
     kEveryRelease},
    {"CAN status", "a status frame at least every 0.5 s, with the known layout version", "docs/can.md", kEveryRelease},
}};

const char* controllers_of(Releases releases) {
  const bool px4 = (releases & kEveryPx4) != 0, ardupilot = (releases & kEveryArdupilot) != 0;
  return px4 && ardupilot ? "both" : px4 ? "PX4" : "ArduPilot";
}

std::string line_of(const RuleVerdict& v, HostStamp begin) {
  const RuleInfo& info = info_of(v.rule);
  std::string line = fmt::format("{:9} {:10} {}", kRuleStateNames[static_cast<int>(v.state())],
                                 controllers_of(info.releases), info.name);
  if (!v.figure.empty()) line += ": " + v.figure;
  if (v.state() != RuleState::kBroken) return line + "\n";
  return line + fmt::format("\n{:20} {} of {}, first after {:.2f} s: {}\n{:20} rule: {} [{}]\n", "", v.broken,
                            v.checked, (v.first_at - begin).seconds(), v.first, "", info.demand, info.source);
}

std::optional<Releases> releases_of_word(std::string_view word) {
  if (word == "px4") return kEveryPx4 & kUsualReleases;
  if (word == "ardupilot") return kEveryArdupilot;
  if (word == "all") return kEveryRelease;
  for (std::size_t i = 0; i < mavlink::kControllerReleases.size(); ++i)
    if (word == mavlink::kControllerReleases[i].option) return 1U << i;
  return std::nullopt;
}

}  // namespace

const RuleInfo& info_of(Rule rule) { return kInfo[static_cast<std::size_t>(rule)]; }

std::string release_options() {
  std::string all;
  for (const mavlink::ControllerRelease& r : mavlink::kControllerReleases)
    all += (all.empty() ? "" : ", ") + std::string(r.option);
  return all;
}

std::optional<Releases> releases_from(std::string_view words) {
  Releases all = 0;
  while (true) {
    const std::size_t end = words.find(',');
    const auto some = releases_of_word(words.substr(0, end));
    if (!some) return std::nullopt;
    all |= *some;
    if (end == std::string_view::npos) return all;
    words.remove_prefix(end + 1);
  }
}

std::vector<Rule> Verdict::broken(Releases releases) const {
  std::vector<Rule> list;
  for (const RuleVerdict& v : rules)
    if (v.state() == RuleState::kBroken && (info_of(v.rule).releases & releases) != 0) list.push_back(v.rule);
  return list;
}

RuleBook::RuleBook() {
  for (std::size_t i = 0; i < kRules; ++i) verdict_.rules[i].rule = static_cast<Rule>(i);
}

std::string text_of(const Verdict& verdict, HostStamp begin, Releases releases) {
  std::string text;
  for (const RuleState state : {RuleState::kBroken, RuleState::kKept, RuleState::kNotSeen})
    for (const RuleVerdict& v : verdict.rules)
      if (v.state() == state && (info_of(v.rule).releases & releases) != 0) text += line_of(v, begin);
  for (std::size_t i = 0; i < mavlink::kControllerReleases.size(); ++i) {
    if ((releases >> i & 1U) != 0)
      text += fmt::format("{} {} the odometry\n", mavlink::kControllerReleases[i].name,
                          verdict.accepted_by(1U << i) ? "accepts" : "REFUSES");
  }
  return text;
}

}  // namespace epiline::hil
