#include "drivers/study/report/flight_mcap.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "drivers/flights/recordings/cdr_writer.h"
#include "drivers/flights/recordings/image_codecs.h"
#include "drivers/flights/recordings/ros_definitions.h"
#include "drivers/links/stream/vehicle_odometry.h"

namespace epiline {

namespace {

constexpr const char *kWorld = "odom", *kBody = "base_link", *kTruth = "ground_truth";  // REP 105

std::string camera_name(std::size_t number) { return "cam" + std::to_string(number); }

CdrWriter& put_quaternion(CdrWriter& out, const std::array<double, 4>& wxyz) {
  return out.f64(wxyz[1]).f64(wxyz[2]).f64(wxyz[3]).f64(wxyz[0]);
}

/// The whole matrix of an upper triangle.
void put_symmetric(CdrWriter& out, const Covariance6& triangle) {
  const auto at = [](int i, int j) { return static_cast<std::size_t>(i * (11 - i) / 2 + j); };
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) out.f64(static_cast<double>(triangle[i <= j ? at(i, j) : at(j, i)]));
}

/// 3x3 zeros: not known.
CdrWriter& put_unknown(CdrWriter& out) { return out.f64s(std::array<double, 9>{}); }

using Colour = std::array<double, 4>;
/// From new to old.
Colour colour_of(std::uint32_t age) {
  const double share = std::min(1.0, age / 20.0);
  return {1 - share, share, 0.2, 1};
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
                     {"solved", outcome.result.solved ? "1" : "0"}, {"keyframe", outcome.result.keyframe ? "1" : "0"}};
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

FlightMcap::FlightMcap(const std::filesystem::path& path) : file_(path) {
  for (std::size_t camera = 0; camera < images_.size(); ++camera) {
    images_[camera] = {"/" + camera_name(camera) + "/image_raw/compressed", "sensor_msgs/CompressedImage"};
    tracks_[camera] = {"/" + camera_name(camera) + "/tracks", "foxglove_msgs/ImageAnnotations"};
  }
}

void FlightMcap::write(Topic& topic, HostStamp stamp, const CdrWriter& message) {
  if (topic.channel == 0) {
    std::string type = topic.type;
    type.insert(type.find('/'), "/msg");
    topic.channel = file_.add_channel(topic.name, type, ros_definition(topic.type));
  }
  file_.write(topic.channel, stamp.ns, message.bytes());
}

void FlightMcap::imu(const ImuSample& sample) noexcept {
  CdrWriter out;
  out.header(sample.stamp, kBody);
  put_quaternion(out, {1, 0, 0, 0}).f64(-1).f64s(std::array<double, 8>{});  // -1: no orientation
  put_unknown(out.f64s(sample.angular_velocity_rad_s));
  put_unknown(out.f64s(sample.specific_force_m_s2));
  write(imu_, sample.stamp, out);
}

void FlightMcap::write_image(std::size_t camera, const Frame& frame) {
  if (frame.data == nullptr) return;
  CdrWriter out;
  out.header(frame.stamp, camera_name(camera)).text("png");
  out.block(png_of({frame.data, frame.width, frame.height, frame.stride}));
  write(images_[camera], frame.stamp, out);
}

void FlightMcap::image(const Frame& frame, const OtherFrames& others) noexcept {
  write_image(0, frame);
  for (std::size_t i = 0; i < others.size(); ++i) write_image(1 + i, others[i]);
}

void FlightMcap::take(const FrameOutcome& outcome) noexcept {
  if (outcome.result.has_pose) write_pose(outcome);
  write_diagnostics(outcome);
}

void FlightMcap::write_pose(const FrameOutcome& outcome) {
  const Odometry& o = outcome.odometry;
  const VehicleOdometry body = in_vehicle_axes(o, Mat3::Identity());
  CdrWriter odometry, pose, tf;
  odometry.header(outcome.stamp, kWorld).text(kBody).f64s(o.p_WB_m);
  put_symmetric(put_quaternion(odometry, o.q_WB), body.pose_covariance);
  for (int i = 0; i < 3; ++i) odometry.f64(static_cast<double>(body.v_V_m_s[i]));
  put_symmetric(odometry.f64s(o.omega_B_rad_s), body.velocity_covariance);
  write(odometry_, outcome.stamp, odometry);
  put_quaternion(pose.header(outcome.stamp, kWorld).f64s(o.p_WB_m), o.q_WB);
  write(pose_, outcome.stamp, pose);
  put_quaternion(tf.u32(1).header(outcome.stamp, kWorld).text(kBody).f64s(o.p_WB_m), o.q_WB);
  write(tf_, outcome.stamp, tf);
}

void FlightMcap::write_diagnostics(const FrameOutcome& outcome) {
  const Figures figures = figures_of(outcome);
  const HealthState state = outcome.odometry.health.state;
  CdrWriter out;
  out.header(outcome.stamp, "").u32(1).u8(level_of(state)).text("epiline: odometry");
  out.text(kHealthStateNames[static_cast<std::size_t>(state)]).text("").u32(figures.size());
  for (const auto& [name, value] : figures) out.text(name).text(value);
  write(diagnostics_, outcome.stamp, out);
}

void FlightMcap::tracks(const LoggedTracks& tracks) noexcept {
  write_points(0, tracks.stamp, {tracks.points.begin(), tracks.points.size()});
  for (std::size_t i = 0; i < tracks.others.size(); ++i)
    if (!tracks.others[i].empty())
      write_points(1 + i, tracks.stamp, {tracks.others[i].begin(), tracks.others[i].size()});
}

/// Foxglove counts pixels from the corner of the first one, epiline from its centre.
void FlightMcap::write_points(std::size_t camera, HostStamp stamp, std::span<const LoggedPoint> points) {
  constexpr std::size_t kCircles = 0, kTexts = 0, kAnnotations = 1;
  constexpr unsigned kPoints = 1;
  constexpr Colour kNoColour = {0, 0, 0, 0};
  CdrWriter out;
  out.u32(kCircles).u32(kAnnotations).time(stamp).u8(kPoints).u32(points.size());
  for (const LoggedPoint& point : points)
    out.f64(static_cast<double>(point.u) + 0.5).f64(static_cast<double>(point.v) + 0.5);
  out.f64s(kNoColour).u32(points.size());
  for (const LoggedPoint& point : points) out.f64s(colour_of(point.age));
  constexpr double kThickness_px = 5;
  out.f64s(kNoColour).f64(kThickness_px).u32(kTexts);
  write(tracks_[camera], stamp, out);
}

Status FlightMcap::finish(const std::optional<Trajectory>& truth) {
  if (truth)
    for (const TimedPose& pose : truth->poses) {
      CdrWriter out;
      out.header(pose.stamp, kTruth).f64s({pose.p_WB.data(), 3}).f64s({pose.q_WB.coeffs().data(), 4});
      write(truth_, pose.stamp, out);
    }
  return file_.finish();
}

}  // namespace epiline
