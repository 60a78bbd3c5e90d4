#include "tests/flights/silence_run.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <optional>

#include "drivers/study/evaluate/alignment.h"
#include "drivers/study/evaluate/consistency.h"
#include "estimator/inertial/imu_history.h"
#include "estimator/inertial/nav_state.h"
#include "tests/flights/fault_run.h"

namespace epiline::test {

namespace {

constexpr double kDegrees = 180 / std::numbers::pi;
constexpr double kLatestPose_s = 8;
using Covariance = Eigen::Matrix<double, 16, 16, Eigen::RowMajor>;
using PoseChange = Eigen::Matrix<double, 4, 15>;  ///< of the states' errors; rows: position, heading

Mat15 states_of(const Odometry& o) { return Eigen::Map<const Covariance>(o.covariance.data()).topLeftCorner<15, 15>(); }

/// How an error of a state becomes one of a later state, and what is added; position and velocity in W.
struct Transition {
  Mat15 F, Q;
};

ImuHistory::Density density_of(const ImuNoise& noise) { return {.noise = in_flight({}, noise)}; }

/// The covariance of the errors of two states, P1 and P2 being their own: the second is the first one carried on by the
/// readings and, unless a new window began with it, corrected by what was seen, as a Kalman filter does it.
Mat15 covariance_between(const Mat15& P2, const Mat15& P1, const Transition& t, bool corrected) {
  const Mat15 carried = t.F * P1;
  if (!corrected) return carried;
  const Mat15 before_correction = carried * t.F.transpose() + t.Q;
  const Vec15 unit = before_correction.diagonal().cwiseSqrt().cwiseInverse();
  const Mat15 scaled = unit.asDiagonal() * before_correction * unit.asDiagonal();
  const Mat15 scaled_carried = unit.asDiagonal() * carried;
  return P2 * unit.asDiagonal() * scaled.ldlt().solve(scaled_carried);
}

/// Readings that the pipeline got.
class Readings {
 public:
  Readings(const std::vector<ImuSample>& all, HostStamp first_image, const std::vector<Silence>& silences) {
    for (const ImuSample& r : all) {
      const double t = (r.stamp - first_image).seconds();
      const bool lost = std::any_of(silences.begin(), silences.end(), [&](const Silence& s) {
        return s.of_imu && t >= s.from_s && t < s.from_s + s.duration_s;
      });
      if (!lost) readings_.push_back(r);
    }
  }

  /// From the state `o` to `to` by the readings alone, with the densities that the estimator assumes.
  std::optional<Transition> transition(const Odometry& o, HostStamp to, const ImuHistory::Density& density) const {
    const auto history = std::make_unique<ImuHistory>();
    for (const ImuSample& r : readings_)
      if (r.stamp > o.stamp - kAround && r.stamp < to + kAround) history->push(r);
    Preintegration interval;
    interval.reset(Vec3(o.accelerometer_bias_m_s2.data()), Vec3(o.gyroscope_bias_rad_s.data()));
    if (!history->integrate(o.stamp, to, density, interval)) return std::nullopt;
    const Mat3 R = pose_of(o).q_WB.toRotationMatrix();
    Mat15 turn = Mat15::Identity();
    turn.block<3, 3>(0, 0) = turn.block<3, 3>(6, 6) = R;
    return Transition{turn * interval.J * turn.transpose(), turn * interval.C * turn.transpose()};
  }

 private:
  static constexpr Span kAround = Span::from_milliseconds(100);
  std::vector<ImuSample> readings_;
};

struct Change {
  Vec3 position_error = Vec3::Zero();
  double heading_error = 0;
  Eigen::Matrix4d claimed = Eigen::Matrix4d::Zero();
};

/// The change from one pose to the other against the true one, in axes of the estimate's heading at the first, whose
/// position and heading are taken out of the errors and out of the covariance claimed.
Change change_between(const Odometry& from, const Odometry& to, const TimedPose& true_from, const TimedPose& true_to,
                      const Transition& t) {
  const TimedPose a = pose_of(from), b = pose_of(to);
  const double heading = yaw_error(a, true_from);
  Change c;
  c.position_error = yaw_rotation(heading).transpose() * (true_to.p_WB - true_from.p_WB) - (b.p_WB - a.p_WB);
  c.heading_error = std::remainder(yaw_error(b, true_to) - heading, 2 * std::numbers::pi);
  PoseChange second = PoseChange::Zero(), first = PoseChange::Zero();
  const Vec3 up = Vec3::UnitZ();
  second.block<3, 3>(0, 0).setIdentity();
  second.block<1, 3>(3, 3) = up.transpose() * b.q_WB.toRotationMatrix();
  const Eigen::RowVector3d turn = up.transpose() * a.q_WB.toRotationMatrix();
  first.block<3, 3>(0, 0) = -Mat3::Identity();
  first.block<3, 3>(0, 3) = -up.cross(b.p_WB - a.p_WB) * turn;
  first.block<1, 3>(3, 3) = -turn;
  const Mat15 P1 = states_of(from), P2 = states_of(to);
  Eigen::Matrix4d cross = Eigen::Matrix4d::Zero();  // none is known to a search for a start
  const bool corrected = (to.health.reasons & bit(HealthReason::kPosteriorWide)) == 0;
  if (from.reset_counter == to.reset_counter)
    cross = second * covariance_between(P2, P1, t, corrected) * first.transpose();
  c.claimed = second * P2 * second.transpose() + cross + cross.transpose() + first * P1 * first.transpose();
  return c;
}

double nees(const Vec3& error, const Mat3& covariance) {
  const Eigen::LLT<Mat3> P(covariance);
  return P.info() == Eigen::Success ? error.dot(P.solve(error)) / 3 : std::numeric_limits<double>::infinity();
}

void set_errors(const Change& c, SilenceVerdict& v) {
  v.position_error_m = c.position_error.norm();
  v.heading_error_deg = kDegrees * std::abs(c.heading_error);
  const Mat3 P = c.claimed.topLeftCorner<3, 3>();
  v.position_sigma_m = std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Mat3>(P).eigenvalues().maxCoeff()));
  v.heading_sigma_deg = kDegrees * std::sqrt(std::max(0.0, c.claimed(3, 3)));
  v.position_nees = nees(c.position_error, P);
  v.heading_nees = c.claimed(3, 3) > 0 ? c.heading_error * c.heading_error / c.claimed(3, 3)
                                       : std::numeric_limits<double>::infinity();
}

}  // namespace

std::vector<SilenceVerdict> fly_with_silences(ReplayOptions options, const std::vector<Silence>& silences) {
  const auto dataset = open_asl_dataset(options.dataset, options.camera, {}, {});
  if (!dataset || !dataset->ground_truth) return {};
  PublishedOdometry published(dataset->instants_count());
  options.odometry = &published;
  for (const Silence& s : silences)
    options.faults.push_back({s.of_imu ? FaultKind::kImuSilent : FaultKind::kCameraSilent, s.from_s, s.duration_s});
  const auto result = replay(options, [](std::size_t, std::size_t) {});
  if (!result || result->record.images.empty()) return {};
  const HostStamp zero = result->record.images.front().stamp;
  const Readings readings(dataset->imu_samples, zero, silences);
  const ImuHistory::Density density = density_of(dataset->imu.noise);
  const Span gap = longest_gap(*dataset->ground_truth);
  const auto seconds = [&](const Odometry& o) { return (o.stamp - zero).seconds(); };
  const std::vector<Odometry>& all = published.all();

  std::vector<SilenceVerdict> verdicts;
  for (std::size_t i = 0; i < silences.size(); ++i) {
    SilenceVerdict& v = verdicts.emplace_back();
    v.silence = silences[i];
    const double to_s = v.silence.from_s + v.silence.duration_s;
    const double next_s = i + 1 < silences.size() ? silences[i + 1].from_s : std::numeric_limits<double>::infinity();
    const auto after = std::find_if(all.begin(), all.end(), [&](const Odometry& o) { return seconds(o) >= to_s; });
    const auto end = std::find_if(after, all.end(), [&](const Odometry& o) { return seconds(o) >= next_s; });
    auto before = after;
    while (before != all.begin() && (before == all.end() || seconds(*before) >= v.silence.from_s)) --before;
    if (before == after || after == end || before->health.state != HealthState::kTracking) continue;
    v.first_pose_s = seconds(*after) - to_s;
    v.longest_step_s = (after->stamp - before->stamp).seconds();
    v.reset = after->reset_counter != before->reset_counter;
    v.state = after->health.state;
    const auto tracking =
        std::find_if(after, end, [](const Odometry& o) { return o.health.state == HealthState::kTracking; });
    if (tracking != end) v.tracking_s = seconds(*tracking) - to_s;
    TimedPose true_before, true_after;
    std::size_t hint = 0;
    const bool known = interpolate(*dataset->ground_truth, before->stamp, gap, true_before, hint) &&
                       interpolate(*dataset->ground_truth, after->stamp, gap, true_after, hint);
    const auto t = readings.transition(*before, after->stamp, density);
    if (!known || !t || v.first_pose_s > kLatestPose_s) continue;
    v.judged = true;
    set_errors(change_between(*before, *after, true_before, true_after, *t), v);
  }
  return verdicts;
}

}  // namespace epiline::test
