#include "tests/flights/fault_run.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>

#include "drivers/study/evaluate/consistency.h"

namespace epiline::test {

namespace {

constexpr double kSigmas = 3.5;
// What the truth itself may be off by, between its samples.
constexpr double kPositionFloor_m = 0.005, kVelocityFloor_m_s = 0.01, kTiltFloor_rad = 0.002;
constexpr Span kGap = Span::from_milliseconds(100);  // of the truth, that may be interpolated over

struct Compared {
  const Odometry* odometry = nullptr;
  TimedPose estimate, truth;
  Vec3 velocity_truth = Vec3::Zero();
};

/// The truth's own velocities where it has them: a recording's truth may jump, and differences of its positions with it
/// (MH_01: 3.3 mm from one pose to the next at 12.77 s, 0.33 m/s by differences over 10 ms).
std::optional<Vec3> true_velocity(const Trajectory& truth, HostStamp stamp, std::size_t hint) {
  if (truth.v_WB_m_s.size() == truth.poses.size()) return velocity_at(truth, stamp);
  constexpr Span kHalf = Span::from_milliseconds(5);
  TimedPose before, after;
  if (!interpolate(truth, stamp - kHalf, kGap, before, hint) || !interpolate(truth, stamp + kHalf, kGap, after, hint))
    return std::nullopt;
  return (after.p_WB - before.p_WB) / (kHalf + kHalf).seconds();
}

std::optional<Compared> compare(const Odometry& o, const Trajectory& truth, std::size_t& hint) {
  Compared c{&o, pose_of(o), {}, Vec3::Zero()};
  const std::size_t before = hint;
  if (!interpolate(truth, o.stamp, kGap, c.truth, hint)) return std::nullopt;
  const auto velocity = true_velocity(truth, o.stamp, before);
  if (!velocity) return std::nullopt;
  c.velocity_truth = *velocity;
  return c;
}

double largest(const Mat3& covariance) {
  return std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Mat3>(covariance).eigenvalues().maxCoeff()));
}

/// Heading and origin of the estimate against the truth.
struct Frame4 {
  double yaw = 0;
  Vec3 t = Vec3::Zero();
  // of a single pose that it was taken from, which is as uncertain as any
  double sigma_p = 0, sigma_yaw = 0;
  Vec3 p = Vec3::Zero();
};

Frame4 frame_of(const std::vector<Compared>& list) {
  std::vector<Vec3> estimate, truth;
  double sine = 0, cosine = 0;
  for (const Compared& c : list) {
    const double yaw = yaw_of(c.truth.q_WB.toRotationMatrix() * c.estimate.q_WB.toRotationMatrix().transpose());
    sine += std::sin(yaw);
    cosine += std::cos(yaw);
  }
  Frame4 f;
  f.yaw = std::atan2(sine, cosine);
  for (const Compared& c : list) f.t += c.truth.p_WB - yaw_rotation(f.yaw) * c.estimate.p_WB;
  f.t /= static_cast<double>(std::max<std::size_t>(1, list.size()));
  return f;
}

/// Of one pose, with its uncertainty.
Frame4 frame_at(const Compared& c) {
  using Covariance = Eigen::Matrix<double, 16, 16, Eigen::RowMajor>;
  const Eigen::Map<const Covariance> P(c.odometry->covariance.data());
  Frame4 f = frame_of({c});
  f.sigma_p = largest(P.block<3, 3>(0, 0));
  f.sigma_yaw = largest(P.block<3, 3>(3, 3));
  f.p = c.estimate.p_WB;
  return f;
}

/// Of the pose to which the published covariances are relative, without any uncertainty then; none if it is not known.
std::optional<Frame4> frame_of_origin(std::span<const WorldOrigin> origins, std::uint32_t segment,
                                      const Trajectory& truth) {
  const auto origin = std::find_if(origins.begin(), origins.end(),
                                   [&](const WorldOrigin& w) { return w.known && w.reset_counter == segment; });
  Compared c;
  std::size_t hint = 0;
  if (origin == origins.end() || !interpolate(truth, origin->stamp, kGap, c.truth, hint)) return std::nullopt;
  const auto& q = origin->q_WB;
  c.estimate = {origin->stamp, Vec3(origin->p_WB_m.data()), Eigen::Quaterniond(q[0], q[1], q[2], q[3])};
  return frame_of({c});
}

double position_error(const Compared& c, const Frame4& f) {
  return (yaw_rotation(f.yaw) * c.estimate.p_WB + f.t - c.truth.p_WB).norm();
}

struct Ratio {
  double value = 0;
  char what = ' ';
};

Ratio worst_ratio(const Compared& c, const Frame4& f) {
  using Covariance = Eigen::Matrix<double, 16, 16, Eigen::RowMajor>;
  const Eigen::Map<const Covariance> P(c.odometry->covariance.data());
  const auto against = [](double error, double sigma, double floor) { return error / (sigma + floor); };
  const double sigma_p =
      std::hypot(largest(P.block<3, 3>(0, 0)), f.sigma_p, f.sigma_yaw * (c.estimate.p_WB - f.p).norm());
  const double p = against(position_error(c, f), sigma_p, kPositionFloor_m);
  const Vec3 v_B = c.estimate.q_WB.conjugate() * Vec3(c.odometry->v_WB_m_s.data());
  const double v = against((v_B - c.truth.q_WB.conjugate() * c.velocity_truth).norm(), largest(P.block<3, 3>(6, 6)),
                           kVelocityFloor_m_s);
  // tilt: where the world's z axis points, seen from the body
  const Vec3 up = c.estimate.q_WB.conjugate() * Vec3::UnitZ(), up_truth = c.truth.q_WB.conjugate() * Vec3::UnitZ();
  const double tilt =
      against(std::asin(std::min(1.0, up.cross(up_truth).norm())), largest(P.block<3, 3>(3, 3)), kTiltFloor_rad);
  Ratio r{p, 'p'};
  if (v > r.value) r = {v, 'v'};
  if (tilt > r.value) r = {tilt, 't'};
  return r;
}

}  // namespace

FaultVerdict fly_with(ReplayOptions options, const std::vector<Fault>& faults, const FaultTimes& times) {
  const auto dataset = open_asl_dataset(options.dataset, options.camera, {}, {});
  if (!dataset || !dataset->ground_truth) return {};
  PublishedOdometry published(200'000);
  options.faults = faults;
  options.odometry = &published;
  const auto result = replay(options, [](std::size_t, std::size_t) {});
  if (!result || result->record.images.empty()) return {};
  const HostStamp zero = dataset->instant(0);  // not the first that was tracked: a busy machine may lose that one
  return judge(published.all(), *dataset->ground_truth, zero, times);
}

FaultVerdict judge(const std::vector<Odometry>& published, const Trajectory& truth, HostStamp zero,
                   const FaultTimes& times, std::span<const WorldOrigin> origins) {
  const double from_s = times.from_s, to_s = times.to_s;
  constexpr double kLasting_s = 1;
  FaultVerdict verdict;
  verdict.ran = true;
  std::vector<Compared> quiet;
  std::optional<Frame4> frame;
  std::uint32_t segment = 0;
  std::size_t hint = 0;
  double tracking_since = -1, last_s = from_s;
  for (const Odometry& o : published) {
    const double t = (o.stamp - zero).seconds();
    if (&o != published.data() && o.stamp < (&o)[-1].stamp) hint = 0;
    const bool tracking = o.health.state == HealthState::kTracking;
    const auto c = compare(o, truth, hint);
    if (t < from_s) {
      segment = o.reset_counter;
      if (c && tracking && t > from_s - 5) quiet.push_back(*c);
      if (t > from_s - 1) verdict.reasons_before |= o.health.reasons;
      // of an IMU that falls silent the last reading, and with it the stamp of what says so, lies just before
      if (t > from_s - 0.02) verdict.reasons |= o.health.reasons & bit(HealthReason::kImuSilent);
      continue;
    }
    if (!frame) frame = frame_of_origin(origins, o.reset_counter, truth);
    if (!frame && !quiet.empty()) frame = frame_of(quiet);
    ++verdict.published;
    if (t < times.said_until_s) {
      verdict.reasons |= o.health.reasons;
      verdict.degraded |= o.health.state == HealthState::kDegraded;
      verdict.lost |= o.health.state == HealthState::kLost;
      verdict.initialising |= o.health.state == HealthState::kInitialising;
    }
    if (!tracking) verdict.not_tracking_s += std::max(0.0, t - last_s);
    last_s = std::max(last_s, t);
    if (!tracking) tracking_since = -1;
    if (tracking && tracking_since < 0) tracking_since = t;
    if (verdict.recovered_s < 0 && tracking_since >= 0 && t >= to_s && t - tracking_since >= kLasting_s)
      verdict.recovered_s = std::max(0.0, tracking_since - to_s);
    if (!c) continue;
    if (!frame) frame = frame_at(*c);
    if (o.reset_counter != segment) {
      verdict.resets += o.reset_counter - segment;
      segment = o.reset_counter;
      frame = frame_of_origin(origins, segment, truth);
      if (!frame) frame = frame_at(*c);
    }
    verdict.final_error_m = position_error(*c, *frame);
    const Ratio r = worst_ratio(*c, *frame);
    if (!tracking) continue;
    if (r.value > kSigmas) ++verdict.wrong;
    if (r.value > verdict.worst_ratio) {
      verdict.worst_ratio = r.value;
      verdict.worst_what = r.what;
      verdict.worst_at_s = t;
    }
  }
  return verdict;
}

TimedPose pose_of(const Odometry& o) {
  return {o.stamp, Vec3(o.p_WB_m.data()), Eigen::Quaterniond(o.q_WB[0], o.q_WB[1], o.q_WB[2], o.q_WB[3])};
}

std::string reason_names(std::uint32_t reasons) {
  std::string s;
  for (std::size_t i = 0; i < kHealthReasonNames.size(); ++i)
    if (reasons >> i & 1U) s += (s.empty() ? "" : ", ") + std::string(kHealthReasonNames[i]);
  return s.empty() ? "nothing" : s;
}

}  // namespace epiline::test
