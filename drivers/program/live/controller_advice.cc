#include "drivers/program/live/controller_advice.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace epiline {

namespace {

using mavlink::ControllerAnswers;
using mavlink::kArduPilot;
using mavlink::kPx4;

constexpr int kHorizontal = 1, kHeight = 2, kVelocity = 4, kYaw = 8;  // bits of EKF2_EV_CTRL
constexpr int kVisionSwitch = 8;                                      // bit of EKF2_SENS_EN
constexpr double kExternalNav = 6, kCompass = 1, kGps = 3;            // of EK3_SRC1_...
constexpr double kMostQualityDegraded = 50;

/// What there is to compare with.
struct Situation {
  const ControllerAnswers& answers;
  const MavlinkConfig& config;

  bool is_odometry() const { return config.message == 0; }
  bool is_local_frd() const { return config.frame == 0; }
  const mavlink::ControllerRelease* release() const { return answers.release(); }
  /// False if the controller did not say.
  bool is(const char* name, double value) const { return answers.parameter(name) == value; }
  int bits(const char* name, int unknown) const { return static_cast<int>(answers.parameter(name).value_or(unknown)); }
  int vision() const { return bits("EKF2_EV_CTRL", 15); }
  bool has_compass() const { return !is("SYS_HAS_MAG", 0) && !is("EKF2_MAG_TYPE", 5); }
};

struct SettingRule {
  std::uint8_t autopilot;
  const char* name;
  bool (*is_wrong)(const Situation&, double value);
  bool is_error;
  const char* consequence;  ///< of "NAME is VALUE: "
  const char* remedy;
  const char* source;  ///< in the controller's source tree
};

bool lacks(double bits, int bit) { return (static_cast<int>(bits) & bit) == 0; }

bool pulls_beside_vision(const Situation& s, double gps_type) {
  return gps_type != 0 && s.release() != nullptr && s.release()->fuses_gps_beside_vision;
}
constexpr const char* kTwoPull = "before 4.7 ArduPilot fuses a GPS beside the odometry, and the two pull at each other";

constexpr const char* kVisionControl = "set EKF2_EV_CTRL to 15, or to 7 with a compass that you trust";

// Several rules may be about one parameter; the first that applies speaks.
constexpr SettingRule kRules[] = {
    {kPx4, "EKF2_EN", [](const Situation&, double v) { return v == 0; }, true, "the filter that takes odometry is off",
     "set EKF2_EN to 1", "ekf2 module.yaml"},
    {kPx4, "EKF2_EV_CTRL", [](const Situation&, double v) { return v == 0; }, true, "PX4 uses nothing of the odometry",
     kVisionControl, "ekf2 params_external_vision.yaml"},
    {kPx4, "EKF2_EV_CTRL", [](const Situation&, double v) { return lacks(v, kHorizontal); }, true,
     "PX4 does not use the horizontal position", kVisionControl, "ekf2 ev_pos_control.cpp"},
    {kPx4, "EKF2_EV_CTRL", [](const Situation& s, double v) { return lacks(v, kYaw) && !s.has_compass(); }, true,
     "nothing tells PX4 its heading, as it has no compass",
     "set EKF2_EV_CTRL to 15, or give it a compass that you trust (SYS_HAS_MAG, EKF2_MAG_TYPE)",
     "ekf2 ev_yaw_control.cpp"},
    {kPx4, "EKF2_EV_CTRL", [](const Situation& s, double v) { return s.is_odometry() && lacks(v, kVelocity); }, false,
     "PX4 does not use the velocity", kVisionControl, "ekf2 ev_vel_control.cpp"},
    {kPx4, "EKF2_HGT_REF",
     [](const Situation& s, double v) { return v == 3 && s.vision() != 0 && lacks(s.vision(), kHeight); }, false,
     "PX4 is to take its height from vision, and EKF2_EV_CTRL leaves it out", kVisionControl,
     "ekf2 ev_height_control.cpp"},
    {kPx4, "EKF2_SENS_EN", [](const Situation&, double v) { return lacks(v, kVisionSwitch); }, true,
     "vision is switched off", "add 8 to EKF2_SENS_EN", "ekf2 EKF2.cpp (pull request 26739)"},
    {kPx4, "EKF2_EV_QMIN", [](const Situation& s, double v) { return !s.is_odometry() && v > 0; }, true,
     "VISION_POSITION_ESTIMATE carries no quality and counts as 0, so PX4 uses none",
     "set EKF2_EV_QMIN to 0, or mavlink.message = \"odometry\"",
     "mavlink_receiver.cpp handle_message_vision_position_estimate; ekf2 ev_control.cpp"},
    {kPx4, "EKF2_EV_QMIN", [](const Situation&, double v) { return v > kMostQualityDegraded; }, false,
     "a degraded estimate has a quality of 50 at most, so PX4 uses none of it", "set EKF2_EV_QMIN to 1",
     "ekf2 ev_control.cpp"},
    {kPx4, "EKF2_EV_NOISE_MD", [](const Situation&, double v) { return v == 1; }, false,
     "PX4 ignores how uncertain each pose is", "set EKF2_EV_NOISE_MD to 0", "ekf2 params_external_vision.yaml"},
    {kPx4, "EKF2_EVA_NOISE",
     [](const Situation& s, double v) {
       constexpr double kLeast = 0.05, kRounding = 1e-3;
       return s.release() != nullptr && s.release()->squares_yaw_noise && v > kLeast + kRounding;
     },
     false, "PX4 up to 1.17 takes it for a variance: its heading follows epiline's late (0.1 means 18 degrees)",
     "set EKF2_EVA_NOISE to 0.05", "ekf2 EKF2.cpp (pull request 27342)"},
    {kPx4, "EKF2_EV_DELAY", [](const Situation&, double v) { return v > 50; }, false,
     "PX4 takes poses for older than they are by this many ms: their timestamps are those of the images",
     "set EKF2_EV_DELAY to 0", "ekf2 EKF2.cpp"},
    {kPx4, "EKF2_DELAY_MAX", [](const Situation&, double v) { return v < 100; }, false,
     "PX4 drops poses that are older than this many ms", "set EKF2_DELAY_MAX to 200", "ekf2 module.yaml"},
    {kPx4, "EKF2_MAG_TYPE",
     [](const Situation& s, double v) {
       constexpr double kAtStartOnly = 6;
       return s.is_local_frd() && s.has_compass() && v != kAtStartOnly && !lacks(s.vision(), kYaw);
     },
     false, "whenever odometry pauses, PX4 goes over to the compass's heading, and its map turns",
     "set EKF2_MAG_TYPE to 5 (none), or EKF2_EV_CTRL to 7 with a compass that you trust",
     "ekf2 mag_heading_control.cpp (no compass while ev_yaw, else again)"},

    {kArduPilot, "AHRS_EKF_TYPE", [](const Situation&, double v) { return v != 3; }, true,
     "EKF3, which takes odometry, does not fly the vehicle", "set AHRS_EKF_TYPE to 3", "AP_AHRS.cpp"},
    {kArduPilot, "EK3_ENABLE", [](const Situation&, double v) { return v == 0; }, true,
     "EKF3, which takes odometry, is off", "set EK3_ENABLE to 1", "AP_NavEKF3.cpp"},
    {kArduPilot, "VISO_TYPE", [](const Situation&, double v) { return v == 0; }, true, "ArduPilot ignores odometry",
     "set VISO_TYPE to 1, and restart it", "AP_VisualOdom.cpp enabled()"},
    {kArduPilot, "VISO_TYPE",
     [](const Situation& s, double v) { return v == 1 && s.is_local_frd() && s.is("EK3_SRC1_YAW", kCompass); }, true,
     "the compass points north, epiline's frame anywhere, and nothing turns the poses: position and heading disagree",
     "set VISO_TYPE to 3, which turns them, or EK3_SRC1_YAW to 6",
     "AP_VisualOdom_MAV.cpp; AP_VisualOdom_IntelT265.cpp"},
    {kArduPilot, "VISO_ORIENT", [](const Situation&, double v) { return v != 0; }, true,
     "ArduPilot turns poses that are the vehicle's already", "set VISO_ORIENT to 0", "AP_VisualOdom.cpp"},
    {kArduPilot, "VISO_SCALE", [](const Situation&, double v) { return v != 1; }, true,
     "ArduPilot stretches positions that are in metres", "set VISO_SCALE to 1",
     "AP_VisualOdom_MAV.cpp handle_pose_estimate"},
    {kArduPilot, "VISO_QUAL_MIN", [](const Situation& s, double v) { return !s.is_odometry() && v > 0; }, true,
     "VISION_POSITION_ESTIMATE carries no quality and counts as 0, so ArduPilot uses none",
     "set VISO_QUAL_MIN to 0, or mavlink.message = \"odometry\"", "AP_VisualOdom_MAV.cpp handle_pose_estimate"},
    {kArduPilot, "VISO_QUAL_MIN", [](const Situation&, double v) { return v > kMostQualityDegraded; }, false,
     "a degraded estimate has a quality of 50 at most, so ArduPilot uses none of it", "set VISO_QUAL_MIN to 1",
     "AP_VisualOdom_MAV.cpp handle_pose_estimate"},
    {kArduPilot, "VISO_QUAL_MIN", [](const Situation&, double v) { return v < 0; }, false,
     "ArduPilot uses failed poses, too", "set VISO_QUAL_MIN to 0", "AP_VisualOdom.cpp"},
    {kArduPilot, "VISO_DELAY_MS", [](const Situation&, double v) { return v > 100; }, false,
     "ArduPilot takes poses for older than they are by this many ms", "set VISO_DELAY_MS to 10", "AP_VisualOdom.cpp"},
    {kArduPilot, "EK3_SRC1_POSXY", [](const Situation&, double v) { return v != kExternalNav; }, true,
     "ArduPilot does not take its position from epiline", "set EK3_SRC1_POSXY to 6", "AP_NavEKF_Source.cpp"},
    {kArduPilot, "EK3_SRC1_VELXY", [](const Situation& s, double v) { return s.is_odometry() && v != kExternalNav; },
     false, "ArduPilot does not use the velocity", "set EK3_SRC1_VELXY to 6", "AP_NavEKF_Source.cpp"},
    {kArduPilot, "EK3_SRC1_POSZ", [](const Situation&, double v) { return v == 0 || v == kGps; }, false,
     "ArduPilot's height comes neither from epiline nor from the barometer",
     "set EK3_SRC1_POSZ to 6, or to 1 for the barometer", "AP_NavEKF_Source.cpp"},
    {kArduPilot, "EK3_SRC1_VELZ",
     [](const Situation& s, double v) { return s.is_odometry() && v != kExternalNav && v != 0; }, false,
     "ArduPilot looks elsewhere for the vertical velocity", "set EK3_SRC1_VELZ to 6", "AP_NavEKF_Source.cpp"},
    {kArduPilot, "EK3_SRC1_YAW",
     [](const Situation& s, double v) { return v == 0 || ((v == kCompass || v == 3) && s.is("COMPASS_ENABLE", 0)); },
     true, "nothing tells ArduPilot its heading", "set EK3_SRC1_YAW to 6", "AP_NavEKF_Source.cpp"},
    {kArduPilot, "GPS1_TYPE", pulls_beside_vision, false, kTwoPull, "set GPS1_TYPE to 0 if no GPS is to be used",
     "AP_NavEKF3 (pull request 30076)"},
    {kArduPilot, "GPS_TYPE", pulls_beside_vision, false, kTwoPull, "set GPS_TYPE to 0 if no GPS is to be used",
     "AP_NavEKF3 (pull request 30076)"},
};

const char* program_of(std::uint8_t autopilot) { return autopilot == kPx4 ? "PX4" : "ArduPilot"; }

/// Without these parameters, a build has no odometry in it. None: it has, or it is not known.
const char* missing_in_build(const ControllerAnswers& a) {
  const auto has_any = std::any_of(a.parameters.begin(), a.parameters.end(), [](float v) { return !std::isnan(v); });
  const char* const key = a.autopilot == kPx4 ? "EKF2_EV_CTRL" : "VISO_TYPE";
  return a.is_complete && has_any && !a.parameter(key) ? key : nullptr;
}

void tell_of_release(const ControllerAnswers& a, std::vector<DeviceAdvice>& out) {
  if (a.version != 0 && a.release() == nullptr)
    out.push_back({false, controller_name(a) + " is older than the releases that epiline knows",
                   a.autopilot == kPx4 ? "use PX4 1.14 or later" : "use ArduPilot 4.5 or later"});
  if (const char* const key = missing_in_build(a))
    out.push_back({true, fmt::format("{} has no {}: this build was made without odometry", controller_name(a), key),
                   a.autopilot == kPx4 ? "flash a build with CONFIG_EKF2_EXTERNAL_VISION"
                                       : "flash a build with visual odometry (custom.ardupilot.org)"});
}

std::string list_of(const std::vector<const char*>& words) {
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i)
    text += std::string(i == 0 ? "" : i + 1 == words.size() ? " and " : ", ") + words[i];
  return text;
}

constexpr std::array kUses{"position", "velocity", "height", "yaw"};
using Use = std::array<bool, kUses.size()>;

/// A ratio of PX4's is not a number, or in older releases 0, where nothing is fused.
Use px4_use(const ControllerAnswers& a) {
  const mavlink::FilterStatus& f = a.filter;
  const int wanted = f.vision_active == 0 ? 0 : static_cast<int>(a.parameter("EKF2_EV_CTRL").value_or(15));
  const auto is_fused = [wanted](int bit, float ratio) { return !lacks(wanted, bit) && ratio > 0; };
  return {is_fused(kHorizontal, f.position), is_fused(kVelocity, f.velocity), is_fused(kHeight, f.height),
          is_fused(kYaw, f.heading)};
}

Use ardupilot_use(const ControllerAnswers& a) {
  constexpr unsigned kAttitude = 1, kVelocityIsGood = 2, kPosition = 8 | 16, kHeightIsGood = 32, kStands = 128;
  const unsigned flags = a.filter.flags;
  const auto is_used = [&](const char* source, unsigned bits) {
    const bool is_ours = a.parameter(source).value_or(kExternalNav) == kExternalNav;
    return is_ours && (flags & bits) != 0 && (flags & kStands) == 0;
  };
  return {is_used("EK3_SRC1_POSXY", kPosition), is_used("EK3_SRC1_VELXY", kVelocityIsGood),
          is_used("EK3_SRC1_POSZ", kHeightIsGood), is_used("EK3_SRC1_YAW", kAttitude)};
}

}  // namespace

std::string controller_name(const ControllerAnswers& a) {
  const std::string program = program_of(a.autopilot);
  return a.version == 0 ? program : fmt::format("{} {}.{}", program, a.version / 100, a.version % 100);
}

std::vector<DeviceAdvice> advice_of(const ControllerAnswers& answers, const MavlinkConfig& config) {
  std::vector<DeviceAdvice> out;
  tell_of_release(answers, out);
  const Situation situation{answers, config};
  const char* told = "";
  for (const SettingRule& rule : kRules) {
    const auto value = rule.autopilot == answers.autopilot ? answers.parameter(rule.name) : std::nullopt;
    if (!value || std::string_view(told) == rule.name || !rule.is_wrong(situation, *value)) continue;
    told = rule.name;
    out.push_back({rule.is_error, fmt::format("{} is {:.6g}: {}", rule.name, *value, rule.consequence), rule.remedy});
  }
  return out;
}

std::string survey_note(const ControllerAnswers& a) {
  if (!a.is_complete) return "";
  const auto known = std::count_if(a.parameters.begin(), a.parameters.end(), [](float v) { return !std::isnan(v); });
  if (known == 0) return controller_name(a) + " answers no question: its parameters are not compared";
  return fmt::format("{} answered: {} parameters compared", controller_name(a), known);
}

std::string use_of(const mavlink::LinkState& link, HostStamp now) {
  constexpr Span kSettles = Span::from_seconds(3), kForgotten = Span::from_seconds(10);
  const ControllerAnswers& a = link.answers;
  const HostStamp at = a.filter.at;
  if (at.ns == 0 || now - at > kForgotten || link.sending_since.ns == 0 || at - link.sending_since < kSettles)
    return "";
  const Use use = a.autopilot == kPx4 ? px4_use(a) : ardupilot_use(a);
  std::vector<const char*> used, unused;
  for (std::size_t i = 0; i < use.size(); ++i) (use[i] ? used : unused).push_back(kUses[i]);
  if (used.empty()) return controller_name(a) + " uses nothing of the odometry";
  return fmt::format("{} uses {}{}{}", controller_name(a), list_of(used), unused.empty() ? "" : ", not ",
                     list_of(unused));
}

}  // namespace epiline
