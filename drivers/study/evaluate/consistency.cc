#include "drivers/study/evaluate/consistency.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "drivers/study/evaluate/alignment.h"
#include "estimator/geometry/so3.h"
#include "platform/math/statistics.h"

namespace epiline {

namespace {

/// The errors of one quantity with n degrees of freedom.
template <int n>
class Judgement {
 public:
  /// A covariance that is none is left out.
  void add(const Eigen::Matrix<double, n, 1>& error, const Eigen::Matrix<double, n, n>& covariance) {
    const Eigen::LDLT<Eigen::Matrix<double, n, n>> P(covariance);
    if (P.info() != Eigen::Success || !P.isPositive() || !(P.vectorD().minCoeff() > 0)) return;
    const double normalised_squared = error.dot(P.solve(error));
    sum_ += normalised_squared / n;
    counter_.add(normalised_squared);
  }
  CalibrationCurve curve() const { return counter_.curve(); }
  std::optional<double> nees() const {
    const std::size_t errors = curve().errors;
    return errors > 0 ? std::optional(sum_ / static_cast<double>(errors)) : std::nullopt;
  }

 private:
  double sum_ = 0;
  CurveCounter counter_{n};
};

/// Turns the reference into the estimate's world.
struct Gauge {
  TimedPose estimate, reference;
  double heading = 0;
  Mat3 R = Mat3::Identity();

  Gauge(const TimedPose& e, const TimedPose& r)
      : estimate(e), reference(r), heading(yaw_error(e, r)), R(yaw_rotation(heading).transpose()) {}
  Vec3 position(const Vec3& p) const { return estimate.p_WB + R * (p - reference.p_WB); }
};

/// The gauge of one segment; none if its origin is unknown or the reference does not reach it.
std::optional<Gauge> gauge_of(std::uint32_t segment, const Trajectory& reference, Span max_gap, const Claims& claims) {
  const auto origin = std::find_if(claims.origins.begin(), claims.origins.end(),
                                   [&](const SegmentOrigin& o) { return o.segment == segment; });
  TimedPose truth;
  std::size_t hint = 0;
  if (origin == claims.origins.end() || !interpolate(reference, origin->pose.stamp, max_gap, truth, hint))
    return std::nullopt;
  return Gauge(origin->pose, truth);
}

}  // namespace

double yaw_error(const TimedPose& estimate, const TimedPose& reference) {
  return yaw_of((reference.q_WB * estimate.q_WB.conjugate()).toRotationMatrix());
}

Vec3 velocity_at(const Trajectory& reference, HostStamp stamp) {
  const auto& poses = reference.poses;
  const auto after =
      std::upper_bound(poses.begin(), poses.end(), stamp, [](HostStamp t, const TimedPose& p) { return t < p.stamp; });
  const auto a = static_cast<std::size_t>(after - poses.begin()) - 1, b = std::min(a + 1, poses.size() - 1);
  const double gap = (poses[b].stamp - poses[a].stamp).seconds();
  const double u = gap > 0 ? (stamp - poses[a].stamp).seconds() / gap : 0;
  return (1 - u) * reference.v_WB_m_s[a] + u * reference.v_WB_m_s[b];
}

Span longest_gap(const Trajectory& reference) {
  constexpr Span kUsual = Span::from_milliseconds(100);
  std::vector<double> intervals_s;
  for (std::size_t i = 1; i < reference.poses.size(); ++i) {
    intervals_s.push_back((reference.poses[i].stamp - reference.poses[i - 1].stamp).seconds());
  }
  return std::max(kUsual, Span::from_seconds(2.5 * summarise(std::move(intervals_s)).median));
}

Consistency consistency(const std::vector<PosePair>& pairs, const Trajectory& estimate, const Trajectory& reference,
                        const Claims& claims) {
  const Span max_gap = longest_gap(reference);
  const bool velocities =
      estimate.v_WB_m_s.size() == estimate.poses.size() && reference.v_WB_m_s.size() == reference.poses.size();
  Judgement<3> position, velocity;
  Judgement<2> tilt;
  Judgement<1> yaw;
  std::optional<Gauge> gauge;
  const PoseUncertainty* last = nullptr;
  for (const PosePair& pair : pairs) {
    const PoseUncertainty& u = claims.poses[pair.index];
    if (!last || last->segment != u.segment) gauge = gauge_of(u.segment, reference, max_gap, claims);
    last = &u;
    if (!gauge || pair.estimate.stamp == gauge->estimate.stamp) continue;  // no error by definition: does not count
    const TimedPose &e = pair.estimate, &r = pair.reference;
    position.add(gauge->position(r.p_WB) - e.p_WB, u.position);
    if (velocities)
      velocity.add(gauge->R * velocity_at(reference, e.stamp) - estimate.v_WB_m_s[pair.index], u.velocity);
    const Vec3 turn = so3_log(gauge->R * r.q_WB.toRotationMatrix() * e.q_WB.toRotationMatrix().transpose());
    tilt.add(turn.head<2>(), u.tilt);
    const double heading = std::remainder(yaw_error(e, r) - gauge->heading, 2 * std::numbers::pi);
    yaw.add(Eigen::Matrix<double, 1, 1>(heading), Eigen::Matrix<double, 1, 1>(u.yaw_variance));
  }
  return {position.nees(),
          yaw.nees(),
          velocity.nees(),
          tilt.nees(),
          {position.curve(), yaw.curve(), velocity.curve(), tilt.curve()}};
}

}  // namespace epiline
