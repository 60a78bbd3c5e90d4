#include "drivers/study/report/flight_record.h"

#include <algorithm>

namespace epiline {

namespace {

/// On one of the two clocks.
StageMilliseconds milliseconds(const FrameOutcome& outcome, std::int64_t StageTime::*clock) {
  const auto ms = [&](const StageTime& time) { return 1e-6 * static_cast<double>(time.*clock); };
  const BackEnd::Times& times = outcome.times;
  return {ms(outcome.track), ms(times.solve), ms(times.marginalise), ms(times.estimate)};
}

void set_odometry(ImageRecord& record, const Odometry& o) {
  using Covariance = Eigen::Matrix<double, 16, 16, Eigen::RowMajor>;
  const Eigen::Map<const Covariance> P(o.covariance.data());
  const auto sigma = [&](int first) -> Vec3 { return P.diagonal().segment<3>(first).cwiseMax(0).cwiseSqrt(); };
  record.pose = {record.stamp, vec3(o.p_WB_m), Eigen::Quaterniond(o.q_WB[0], o.q_WB[1], o.q_WB[2], o.q_WB[3])};
  record.v_WB_m_s = vec3(o.v_WB_m_s);
  record.b_a_m_s2 = vec3(o.accelerometer_bias_m_s2);
  record.b_g_rad_s = vec3(o.gyroscope_bias_rad_s);
  record.sigma_v_m_s = sigma(6);
  record.sigma_b_a_m_s2 = sigma(9);
  record.sigma_b_g_rad_s = sigma(12);
  record.time_offset_s = o.time_offset_s;
  const Mat3 R = record.pose.q_WB.toRotationMatrix();
  const Mat3 attitude_W = R * P.block<3, 3>(3, 3) * R.transpose();
  record.uncertainty = {P.topLeftCorner<3, 3>(), attitude_W(2, 2), o.reset_counter, P.block<3, 3>(6, 6),
                        attitude_W.topLeftCorner<2, 2>()};
}

}  // namespace

ImageRecord image_record(const FrameOutcome& outcome) {
  ImageRecord image;
  image.stamp = outcome.stamp;
  image.has_pose = outcome.result.has_pose;
  image.solved = outcome.result.solved;
  image.keyframe = outcome.keyframe;
  if (image.has_pose) set_odometry(image, outcome.odometry);
  image.health = outcome.odometry.health;
  image.tracks = outcome.tracks;
  image.new_tracks = outcome.new_tracks;
  image.wall_ms = milliseconds(outcome, &StageTime::wall_ns);
  image.cpu_ms = milliseconds(outcome, &StageTime::cpu_ns);
  return image;
}

ImuLeftOut imu_left_out(const FlightRecord& r) {
  const EstimatorStats& e = r.estimator;
  const ImuGateStats& w = r.imu_watch;
  return {w.out_of_order + e.imu_out_of_order, w.duplicate + e.imu_duplicate, w.not_finite + e.imu_not_finite,
          w.impossible + e.imu_impossible};
}

Trajectory trajectory_of(const FlightRecord& record) {
  Trajectory t;
  for (const ImageRecord& image : record.images) {
    if (!image.has_pose) continue;
    t.poses.push_back(image.pose);
    t.v_WB_m_s.push_back(image.v_WB_m_s);
  }
  return t;
}

Claims claims_of(const FlightRecord& record) {
  Claims claims;
  for (const ImageRecord& image : record.images) {
    if (image.has_pose) claims.poses.push_back(image.uncertainty);
  }
  for (const WorldOrigin& o : record.estimator.origins) {
    if (o.known)
      claims.origins.push_back(
          {o.reset_counter, {o.stamp, vec3(o.p_WB_m), Eigen::Quaterniond(o.q_WB[0], o.q_WB[1], o.q_WB[2], o.q_WB[3])}});
  }
  return claims;
}

std::string events_text(const FlightRecord& record) {
  std::vector<Event> events = record.events;
  std::stable_sort(events.begin(), events.end(), [](const Event& a, const Event& b) { return a.stamp < b.stamp; });
  std::string text;
  for (const Event& event : events) {
    char line[256];
    text.append(line, format_event(event, line)) += '\n';
  }
  return text;
}

std::optional<TrajectoryErrors> errors_of(const FlightRecord& record) {
  if (!record.truth) return std::nullopt;
  return evaluate(trajectory_of(record), *record.truth, claims_of(record));
}

}  // namespace epiline
