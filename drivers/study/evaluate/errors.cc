#include "drivers/study/evaluate/errors.h"

#include <cmath>
#include <numbers>

namespace epiline {

namespace {

constexpr double kDegree = std::numbers::pi / 180;

Summary position_errors(const std::vector<Vec3>& estimate, const std::vector<Vec3>& reference, const Similarity& T) {
  std::vector<double> errors;
  errors.reserve(estimate.size());
  for (std::size_t i = 0; i < estimate.size(); ++i) errors.push_back((reference[i] - T(estimate[i])).norm());
  return summarise(std::move(errors));
}

/// Length of the true path from the first pair to each pair.
std::vector<double> path_lengths(const std::vector<PosePair>& pairs) {
  std::vector<double> length(pairs.size(), 0);
  for (std::size_t i = 1; i < pairs.size(); ++i) {
    length[i] = length[i - 1] + (pairs[i].reference.p_WB - pairs[i - 1].reference.p_WB).norm();
  }
  return length;
}

/// Error of the motion from pair `a` to pair `b`, seen from the body at `a`.
void relative_error(const PosePair& a, const PosePair& b, double& translation_m, double& rotation_rad) {
  const auto motion = [](const TimedPose& from, const TimedPose& to, Vec3& p, Eigen::Quaterniond& q) {
    p = from.q_WB.conjugate() * (to.p_WB - from.p_WB);
    q = from.q_WB.conjugate() * to.q_WB;
  };
  Vec3 p_e, p_r;
  Eigen::Quaterniond q_e, q_r;
  motion(a.estimate, b.estimate, p_e, q_e);
  motion(a.reference, b.reference, p_r, q_r);
  translation_m = (p_e - p_r).norm();
  rotation_rad = q_e.angularDistance(q_r);
}

RelativeError errors_over(double distance_m, const std::vector<PosePair>& pairs, const std::vector<double>& length) {
  RelativeError e;
  e.distance_m = distance_m;
  double translation_sum = 0, rotation_sum = 0;
  std::size_t j = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    while (j < pairs.size() && length[j] - length[i] < distance_m) ++j;
    if (j == pairs.size()) break;
    double translation_m = 0, rotation_rad = 0;
    relative_error(pairs[i], pairs[j], translation_m, rotation_rad);
    translation_sum += translation_m;
    rotation_sum += rotation_rad;
    ++e.pairs;
  }
  if (e.pairs == 0) return e;
  const auto n = static_cast<double>(e.pairs);
  e.translation_percent = 100 * translation_sum / n / distance_m;
  e.rotation_deg = rotation_sum / n / kDegree;
  return e;
}

std::vector<RelativeError> relative_errors(const std::vector<PosePair>& pairs, const std::vector<double>& length) {
  std::vector<RelativeError> list;
  for (double decade = 1;; decade *= 10) {
    for (const double step : {1.0, 2.0, 5.0}) {
      const RelativeError e = errors_over(step * decade, pairs, length);
      if (e.pairs == 0) return list;
      list.push_back(e);
    }
  }
}

/// Each pair with the first one that is `seconds` later; none where that is more than a twentieth too late.
MotionError motion_error(double seconds, const std::vector<PosePair>& pairs) {
  constexpr double kJitter_s = 0.01;
  std::vector<double> translations_m, rotations_deg;
  std::size_t j = 0;
  for (const PosePair& from : pairs) {
    const auto age = [&](const PosePair& to) { return (to.estimate.stamp - from.estimate.stamp).seconds(); };
    while (j < pairs.size() && age(pairs[j]) < seconds - kJitter_s) ++j;
    if (j == pairs.size()) break;
    if (age(pairs[j]) > 1.05 * seconds) continue;
    double translation_m = 0, rotation_rad = 0;
    relative_error(from, pairs[j], translation_m, rotation_rad);
    translations_m.push_back(translation_m);
    rotations_deg.push_back(rotation_rad / kDegree);
  }
  return {seconds, summarise(std::move(translations_m)), summarise(std::move(rotations_deg))};
}

std::vector<MotionError> motion_errors(const std::vector<PosePair>& pairs) {
  std::vector<MotionError> list;
  for (const double seconds : {1.0, 5.0, 20.0}) {
    MotionError e = motion_error(seconds, pairs);
    if (e.translation_m.count > 0) list.push_back(e);
  }
  return list;
}

/// Mean yaw error of the pairs between two times, as a change against `zero`, so that angles near pi do not cancel.
double mean_yaw_error(const std::vector<PosePair>& pairs, HostStamp from, HostStamp to, double zero) {
  double sum = 0;
  int count = 0;
  for (const PosePair& pair : pairs) {
    if (pair.estimate.stamp < from || pair.estimate.stamp > to) continue;
    sum += std::remainder(yaw_error(pair) - zero, 360 * kDegree);
    ++count;
  }
  return count > 0 ? sum / count : 0;
}

double yaw_drift(const std::vector<PosePair>& pairs) {
  constexpr Span kSecond = Span::from_milliseconds(1000);
  const HostStamp first = pairs.front().estimate.stamp, last = pairs.back().estimate.stamp;
  const double start = mean_yaw_error(pairs, first, first + kSecond, yaw_error(pairs.front()));
  const double end = mean_yaw_error(pairs, last - kSecond, last, yaw_error(pairs.back()));
  const double between = yaw_error(pairs.back()) - yaw_error(pairs.front());
  return std::remainder(between + end - start, 360 * kDegree);
}

}  // namespace

double yaw_error(const PosePair& pair) { return yaw_error(pair.estimate, pair.reference); }

std::vector<PosePair> associate(const Trajectory& estimate, const Trajectory& reference) {
  const Span max_gap = longest_gap(reference);
  std::vector<PosePair> pairs;
  std::size_t hint = 0;
  for (std::size_t i = 0; i < estimate.poses.size(); ++i) {
    PosePair pair{estimate.poses[i], {}, i};
    if (interpolate(reference, pair.estimate.stamp, max_gap, pair.reference, hint)) pairs.push_back(pair);
  }
  return pairs;
}

Overlay overlay(const Trajectory& estimate, const Trajectory& reference) {
  Overlay o;
  o.pairs = associate(estimate, reference);
  std::vector<Vec3> e, r;
  Mat3 rotation_sum = Mat3::Zero();
  for (const PosePair& pair : o.pairs) {
    e.push_back(pair.estimate.p_WB);
    r.push_back(pair.reference.p_WB);
    rotation_sum += yaw_rotation(yaw_error(pair));
  }
  o.T = align(Alignment::k4Dof, e, r);
  o.heading_rad = yaw_of(rotation_sum);
  return o;
}

const Summary& TrajectoryErrors::ate(Alignment alignment) const {
  switch (alignment) {
    case Alignment::k4Dof:
      return ate_4dof;
    case Alignment::kSe3:
      return ate_se3;
    case Alignment::kSim3:
      return ate_sim3;
    case Alignment::kNone:
      break;
  }
  return ate_none;
}

TrajectoryErrors evaluate(const Trajectory& estimate, const Trajectory& reference, const Claims& claims) {
  TrajectoryErrors errors;
  const std::vector<PosePair> pairs = associate(estimate, reference);
  errors.poses = pairs.size();
  if (pairs.empty()) return errors;
  std::vector<Vec3> e, r;
  for (const PosePair& pair : pairs) {
    e.push_back(pair.estimate.p_WB);
    r.push_back(pair.reference.p_WB);
  }
  errors.ate_none = position_errors(e, r, {});
  errors.ate_4dof = position_errors(e, r, align(Alignment::k4Dof, e, r));
  errors.ate_se3 = position_errors(e, r, align(Alignment::kSe3, e, r));
  const Similarity sim3 = align(Alignment::kSim3, e, r);
  errors.ate_sim3 = position_errors(e, r, sim3);
  if (sim3.s > 0) errors.scale_error = 1 / sim3.s - 1;
  errors.yaw_drift_deg = yaw_drift(pairs) / kDegree;
  const std::vector<double> length = path_lengths(pairs);
  errors.path_length_m = length.back();
  errors.rpe = relative_errors(pairs, length);
  errors.motion = motion_errors(pairs);
  if (!claims.poses.empty()) errors.nees = consistency(pairs, estimate, reference, claims);
  return errors;
}

}  // namespace epiline
