#include "drivers/study/report/flight_mcap.h"

#include <fmt/format.h>

#include <algorithm>

#include "drivers/flights/recordings/image_codecs.h"
#include "drivers/flights/recordings/ros_definitions.h"
#include "drivers/study/report/ros_messages.h"

namespace epiline {

namespace {

constexpr const char *kTruth = "ground_truth", *kFlown = "flown";

std::string camera_name(std::size_t number) { return "cam" + std::to_string(number); }

/// 3x3 zeros: not known.
CdrWriter& put_unknown(CdrWriter& out) { return out.f64s(std::array<double, 9>{}); }

using Colour = std::array<double, 4>;
/// From new to old.
Colour colour_of(std::uint32_t age) {
  const double share = std::min(1.0, age / 20.0);
  return {1 - share, share, 0.2, 1};
}

}  // namespace

FlightMcap::FlightMcap(const std::filesystem::path& path) : file_(path) {
  for (std::size_t camera = 0; camera < images_.size(); ++camera) {
    images_[camera] = {fmt::format("/{}/image_raw/compressed", camera_name(camera)), "sensor_msgs/CompressedImage"};
    tracks_[camera] = {fmt::format("/{}/tracks", camera_name(camera)), "foxglove_msgs/ImageAnnotations"};
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
  out.header(sample.stamp, kRosBody).f64s(std::array<double, 4>{0, 0, 0, 1});
  out.f64(-1).f64s(std::array<double, 8>{});  // -1: no orientation
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
  if (outcome.result.has_pose) {
    write(odometry_, outcome.stamp, odometry_message(outcome, outcome.stamp));
    write(pose_, outcome.stamp, pose_message(outcome, outcome.stamp));
    write(tf_, outcome.stamp, transform_message(outcome, outcome.stamp));
  }
  write(diagnostics_, outcome.stamp, diagnostics_message(outcome, outcome.stamp));
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

void FlightMcap::write_path(Topic& topic, const char* frame, const std::optional<Trajectory>& path) {
  if (!path) return;
  for (const TimedPose& pose : path->poses) {
    CdrWriter out;
    out.header(pose.stamp, frame).f64s({pose.p_WB.data(), 3}).f64s({pose.q_WB.coeffs().data(), 4});
    write(topic, pose.stamp, out);
  }
}

Status FlightMcap::finish(const std::optional<Trajectory>& truth, const std::optional<Trajectory>& flown) {
  write_path(truth_, kTruth, truth);
  write_path(flown_, kFlown, flown);
  return file_.finish();
}

}  // namespace epiline
