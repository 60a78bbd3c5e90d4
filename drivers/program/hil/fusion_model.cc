#include "drivers/program/hil/fusion_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "drivers/study/evaluate/alignment.h"

namespace epiline::hil {

namespace {
constexpr double kPositionGate = 5, kVelocityGate = 3;              // EKF2_EVP_GATE, EKF2_EVV_GATE, SD
constexpr double kPositionNoise_m = 0.1, kVelocityNoise_m_s = 0.1;  // EKF2_EVP_NOISE, EKF2_EVV_NOISE
constexpr double kAccelerationNoise_m_s2 = 0.35;                    // EKF2_ACC_NOISE
constexpr Span kStop = Span::from_milliseconds(400), kRefusedFor = Span::from_milliseconds(1000);
// Of the heading: gates in SD and least SD. EKF2_HDG_GATE; EKF2_EVA_NOISE 0.05, a variance, and 0.1, no variance;
// EK3_YAW_I_GATE, VISO_YAW_M_NSE.
constexpr double kPx4HeadingGate = 2.6, kArdupilotHeadingGate = 3;
const double kPx4HeadingBefore_rad = std::sqrt(0.05);
constexpr double kPx4Heading_rad = 0.1, kArdupilotHeading_rad = 0.2;

}  // namespace

std::optional<TruthState> truth_at(const Trajectory& truth, HostStamp recorded) {
  constexpr Span kGap = Span::from_milliseconds(100);
  constexpr Span kBaseline = Span::from_milliseconds(20);  // for velocities the recording does not have
  const std::vector<TimedPose>& poses = truth.poses;
  TimedPose pose;
  std::size_t before = 0;
  if (poses.size() < 2 || !interpolate(truth, recorded, kGap, pose, before)) return std::nullopt;
  before = std::min(before, poses.size() - 2);
  std::size_t after = before + 1;
  TruthState state{pose.p_WB, Vec3::Zero(), pose.q_WB.toRotationMatrix()};
  if (const std::vector<Vec3>& v = truth.v_WB_m_s; !v.empty()) {
    const double share =
        (recorded - poses[before].stamp).seconds() / (poses[after].stamp - poses[before].stamp).seconds();
    state.v_WB = v[before] + share * (v[after] - v[before]);
    return state;
  }
  while (before > 0 && recorded - poses[before].stamp < kBaseline) --before;
  while (after + 1 < poses.size() && poses[after].stamp - recorded < kBaseline) ++after;
  const TimedPose &first = poses[before], &last = poses[after];
  state.v_WB = (last.p_WB - first.p_WB) / (last.stamp - first.stamp).seconds();
  return state;
}

FusionModel::Measurement FusionModel::measurement_of(const VisionSample& s, const TruthState& truth) const {
  const auto variance = [](const Vec3& sigma, double least) {
    return sigma.cwiseMax(least).cwiseAbs2().array().eval();
  };
  const TimedPose pose = pose_of(s, R_VB_);
  Measurement m;
  m.p = pose.p_WB;
  m.has_velocity = s.v_L.has_value();
  m.v = Vec3(1, -1, -1).cwiseProduct(s.v_L.value_or(Vec3::Zero()));
  m.variance_p = variance(s.sigma_p, kPositionNoise_m);
  m.variance_v = variance(s.sigma_v, kVelocityNoise_m_s);
  m.heading_rad = yaw_of(pose.q_WB.toRotationMatrix() * truth.R_WB.transpose());
  if (!m.has_velocity) m.v = yaw_rotation(m.heading_rad) * truth.v_WB;  // to begin with
  return m;
}

void FusionModel::take(const VisionSample& sample, const std::optional<TruthState>& truth, RuleBook& book) {
  if (!truth) {
    newest_.reset();
    return;
  }
  const Measurement m = measurement_of(sample, *truth);
  const bool stopped = !newest_ || sample.stamp - newest_->stamp >= kStop;
  judge_turn(m, sample, stopped, book);
  if (stopped || sample.reset_counter != newest_->reset_counter) {
    start(m);
  } else {
    predict(m, *truth, (sample.stamp - newest_->stamp).seconds());
    if (passes(m, sample.arrival, book)) {
      fuse(m.p - p_, m.variance_p, false);
      if (m.has_velocity) fuse(m.v - v_, m.variance_v, true);
      refused_since_.reset();
    } else if (!refused_since_) {
      refused_since_ = sample.stamp;
    } else if (sample.stamp - *refused_since_ >= kRefusedFor) {
      // the filter starts again from vision: five times in a flight by a reset, then by stopping and starting fusion,
      // which comes to the same
      start(m);
    }
  }
  newest_ = sample;
  newest_truth_ = truth;
}

/// How far the world has turned since the last sample, at a reset. PX4 resets its heading, unless it had stopped and
/// the frame has a north.
void FusionModel::judge_turn(const Measurement& m, const VisionSample& sample, bool stopped, RuleBook& book) {
  const auto before = std::exchange(newest_in_truth_, sample);
  const double turn_rad =
      std::abs(std::remainder(m.heading_rad - std::exchange(newest_heading_rad_, m.heading_rad), 2 * std::numbers::pi));
  if (!before || before->reset_counter == sample.reset_counter) return;
  largest_turn_rad_ = std::max(largest_turn_rad_, turn_rad);
  const auto judge = [&](Rule rule, double gate, double least_rad) {
    const double most_rad = gate * std::max(least_rad, sample.sigma_angle.z());
    const auto degrees = [](double rad) { return rad * 180 / std::numbers::pi; };
    book.judge(rule, turn_rad <= most_rad, sample.arrival, [&] {
      return fmt::format("the frame turned by {:.1f} degrees, at most {:.1f}", degrees(turn_rad), degrees(most_rad));
    });
    book.figure(rule, fmt::format("at most {:.1f} degrees at a reset", degrees(largest_turn_rad_)));
  };
  judge(Rule::kTurnArdupilot, kArdupilotHeadingGate, kArdupilotHeading_rad);
  if (!stopped || !sample.is_north) return;
  judge(Rule::kTurnPx4Before27342, kPx4HeadingGate, kPx4HeadingBefore_rad);
  judge(Rule::kTurnPx4, kPx4HeadingGate, kPx4Heading_rad);
}

void FusionModel::start(const Measurement& m) {
  p_ = m.p;
  v_ = m.v;
  pp_ = m.variance_p;
  pv_.setZero();
  vv_ = m.has_velocity ? m.variance_v : Axes::Constant(std::pow(kVelocityNoise_m_s, 2)).eval();
  refused_since_.reset();
}

void FusionModel::predict(const Measurement& m, const TruthState& truth, double dt) {
  const Mat3 R = yaw_rotation(m.heading_rad);
  const Vec3 gained = R * (truth.v_WB - newest_truth_->v_WB);
  const Vec3 moved = R * (truth.p_WB - newest_truth_->p_WB - newest_truth_->v_WB * dt);
  p_ += v_ * dt + moved.array();
  v_ += gained.array();
  pp_ += 2 * dt * pv_ + dt * dt * vv_;
  pv_ += dt * vv_;
  vv_ += std::pow(kAccelerationNoise_m_s2 * dt, 2);
}

bool FusionModel::passes(const Measurement& m, HostStamp at, RuleBook& book) {
  // innovation over gate, the worst axis
  const double position = ((m.p - p_).abs() / (kPositionGate * (pp_ + m.variance_p).sqrt())).maxCoeff();
  const double velocity =
      m.has_velocity ? ((m.v - v_).abs() / (kVelocityGate * (vv_ + m.variance_v).sqrt())).maxCoeff() : 0;
  worst_position_ = std::max(worst_position_, position);
  worst_velocity_ = std::max(worst_velocity_, velocity);
  book.figure(Rule::kInnovation, fmt::format("at most {:.2f} of the position's gate, {:.2f} of the velocity's",
                                             worst_position_, worst_velocity_));
  return book.judge(Rule::kInnovation, position <= 1 && velocity <= 1, at, [&] {
    return fmt::format("position at {:.2f} of its gate, velocity at {:.2f}", position, velocity);
  });
}

void FusionModel::fuse(const Axes& innovation, const Axes& noise_variance, bool of_velocity) {
  const Axes total = (of_velocity ? vv_ : pp_) + noise_variance;
  const Axes gain_p = (of_velocity ? pv_ : pp_) / total, gain_v = (of_velocity ? vv_ : pv_) / total;
  p_ += gain_p * innovation;
  v_ += gain_v * innovation;
  pp_ -= gain_p * gain_p * total;
  pv_ -= gain_p * gain_v * total;
  vv_ -= gain_v * gain_v * total;
}

}  // namespace epiline::hil
