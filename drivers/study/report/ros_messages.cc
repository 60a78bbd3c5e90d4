#include "drivers/study/report/ros_messages.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "drivers/links/stream/vehicle_odometry.h"

namespace epiline {

namespace {

CdrWriter& put_pose(CdrWriter& out, const Odometry& o) {
  return out.f64s(o.p_WB_m).f64(o.q_WB[1]).f64(o.q_WB[2]).f64(o.q_WB[3]).f64(o.q_WB[0]);
}

/// The whole matrix of an upper triangle.
void put_symmetric(CdrWriter& out, const Covariance6& triangle) {
  const auto at = [](int i, int j) { return static_cast<std::size_t>(i * (11 - i) / 2 + j); };
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) out.f64(static_cast<double>(triangle[i <= j ? at(i, j) : at(j, i)]));
}

std::string names_of(std::uint32_t reasons) {
  std::string names;
  for (std::size_t i = 0; i < kHealthReasonNames.size(); ++i)
    if ((reasons >> i & 1U) != 0) names.append(names.empty() ? "" : ", ").append(kHealthReasonNames[i]);
  return names;
}

double norm(const std::array<double, 3>& v) { return std::hypot(v[0], v[1], v[2]); }

/// The root of the sum of three variances from `first` on.
double sigma(const Odometry& o, std::size_t first) {
  double sum = 0;
  for (std::size_t i = first; i < first + 3; ++i) sum += o.covariance[17 * i];
  return std::sqrt(std::max(0.0, sum));
}

using Figures = std::vector<std::pair<const char*, std::string>>;
Figures figures_of(const FrameOutcome& outcome) {
  const Odometry& o = outcome.odometry;
  Figures figures = {{"reasons", names_of(o.health.reasons)},       {"quality", std::to_string(o.health.quality)},
                     {"tracks", std::to_string(outcome.tracks)},    {"new_tracks", std::to_string(outcome.new_tracks)},
                     {"solved", outcome.result.solved ? "1" : "0"}, {"keyframe", outcome.keyframe ? "1" : "0"}};
  if (!outcome.result.has_pose) return figures;
  const auto add = [&](const char* name, double value) { figures.emplace_back(name, fmt::format("{:.6g}", value)); };
  figures.emplace_back("reset_counter", std::to_string(o.reset_counter));
  add("speed_m_s", norm(o.v_WB_m_s));
  add("sigma_position_m", sigma(o, 0));
  add("sigma_rotation_deg", sigma(o, 3) * 180 / std::numbers::pi);
  add("sigma_velocity_m_s", sigma(o, 6));
  add("accelerometer_bias_m_s2", norm(o.accelerometer_bias_m_s2));
  add("gyroscope_bias_rad_s", norm(o.gyroscope_bias_rad_s));
  add("accelerometer_scale", o.imu_scale[0]);
  add("gyroscope_scale", o.imu_scale[1]);
  add("time_offset_s", o.time_offset_s);
  return figures;
}

/// Of diagnostic_msgs/DiagnosticStatus.
unsigned level_of(HealthState state) {
  constexpr unsigned kOk = 0, kWarn = 1, kError = 2;
  if (state == HealthState::kTracking) return kOk;
  return state == HealthState::kLost ? kError : kWarn;
}

}  // namespace

CdrWriter odometry_message(const FrameOutcome& outcome, HostStamp stamp) {
  const Odometry& o = outcome.odometry;
  const VehicleOdometry body = in_vehicle_axes(o, Mat3::Identity());
  CdrWriter out;
  out.header(stamp, kRosWorld).text(kRosBody);
  put_symmetric(put_pose(out, o), body.pose_covariance);
  for (int i = 0; i < 3; ++i) out.f64(static_cast<double>(body.v_V_m_s[i]));
  put_symmetric(out.f64s(o.omega_B_rad_s), body.velocity_covariance);
  return out;
}

CdrWriter pose_message(const FrameOutcome& outcome, HostStamp stamp) {
  CdrWriter out;
  put_pose(out.header(stamp, kRosWorld), outcome.odometry);
  return out;
}

CdrWriter transform_message(const FrameOutcome& outcome, HostStamp stamp) {
  CdrWriter out;
  put_pose(out.u32(1).header(stamp, kRosWorld).text(kRosBody), outcome.odometry);
  return out;
}

CdrWriter diagnostics_message(const FrameOutcome& outcome, HostStamp stamp) {
  const Figures figures = figures_of(outcome);
  const HealthState state = outcome.odometry.health.state;
  CdrWriter out;
  out.header(stamp, "").u32(1).u8(level_of(state)).text("epiline: odometry");
  out.text(kHealthStateNames[static_cast<std::size_t>(state)]).text("").u32(figures.size());
  for (const auto& [name, value] : figures) out.text(name).text(value);
  return out;
}

}  // namespace epiline
