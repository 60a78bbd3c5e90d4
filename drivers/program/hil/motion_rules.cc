#include "drivers/program/hil/motion_rules.h"

#include <fmt/format.h>

#include <algorithm>

namespace epiline::hil {

namespace {
constexpr Span kPause = Span::from_milliseconds(200), kWindow = Span::from_milliseconds(500);
// PX4's least noise of position, attitude and velocity: a step below one of them is no jump to it.
constexpr double kLeastPosition_m = 0.1, kLeastAngle_rad = 0.1, kLeastVelocity_m_s = 0.1;
constexpr double kSdMost = 3;
// What a vehicle may do within a step that its velocity and rates at both ends do not tell.
constexpr double kAcceleration_m_s2 = 40, kAngularAcceleration_rad_s2 = 100;
}  // namespace

void MotionRules::take(const VisionSample& sample, RuleBook& book) {
  if (newest_) {
    const Step step = step_to(sample);
    judge_reset(sample, step, book);
    if (step.pause || step.changed || step.is_jump()) {
      window_ = {};
      newest_speed_.reset();
    } else {
      follow_velocity(sample, book);
      newest_speed_ = (sample.p_L - newest_->p_L) / (sample.stamp - newest_->stamp).seconds();
    }
  }
  newest_ = sample;
}

MotionRules::Step MotionRules::step_to(const VisionSample& s) const {
  const VisionSample& before = *newest_;
  const double dt = (s.stamp - before.stamp).seconds();
  Vec3 speed = newest_speed_.value_or(Vec3::Zero());
  if (s.v_L && before.v_L) speed = 0.5 * (*s.v_L + *before.v_L);
  Step step;
  step.pause = s.stamp - before.stamp >= kPause;
  step.changed = s.reset_counter != before.reset_counter;
  step.position_m = (s.p_L - before.p_L - speed * dt).norm();
  step.position_most_m = std::max(kLeastPosition_m, s.sigma_p.maxCoeff()) + kSdMost * s.sigma_v.maxCoeff() * dt +
                         0.5 * kAcceleration_m_s2 * dt * dt;
  if (!s.v_L && !newest_speed_) step.position_most_m += 30 * dt;
  const double turned = before.q_LF.angularDistance(s.q_LF);
  step.angle_rad = std::max(0.0, turned - 0.5 * (before.omega_F + s.omega_F).norm() * dt);
  step.angle_most_rad =
      std::max(kLeastAngle_rad, s.sigma_angle.maxCoeff()) + 0.5 * kAngularAcceleration_rad_s2 * dt * dt;
  if (!s.v_L) step.angle_most_rad += 20 * dt;  // and no rates
  return step;
}

void MotionRules::judge_reset(const VisionSample& s, const Step& step, RuleBook& book) {
  if (step.changed) ++resets_;
  if (!step.changed && !step.pause) largest_step_m_ = std::max(largest_step_m_, step.position_m);
  const bool jumps_in_silence = step.is_jump() && !step.changed;
  const bool cries_wolf = step.changed && !step.pause && step.is_smooth();
  book.judge(Rule::kResetCounter, !jumps_in_silence && !cries_wolf, s.arrival, [&] {
    if (cries_wolf) return fmt::format("changed from {} to {} without a jump", newest_->reset_counter, s.reset_counter);
    return fmt::format("a step of {:.3f} m (explained: {:.3f}) and {:.3f} rad (explained: {:.3f}), counter still {}",
                       step.position_m, step.position_most_m, step.angle_rad, step.angle_most_rad, s.reset_counter);
  });
  book.figure(Rule::kResetCounter,
              fmt::format("{} resets, otherwise steps up to {:.3f} m beyond the velocity", resets_, largest_step_m_));
}

/// Over half a second positions move as velocities say, to 3 SD.
void MotionRules::follow_velocity(const VisionSample& s, RuleBook& book) {
  if (!s.v_L || !newest_->v_L) return;
  const Span dt = s.stamp - newest_->stamp;
  window_.length = window_.length + dt;
  window_.moved += s.p_L - newest_->p_L;
  window_.integral += 0.5 * dt.seconds() * (*s.v_L + *newest_->v_L);
  window_.sigma_v = std::max(window_.sigma_v, s.sigma_v.maxCoeff());
  window_.sigma_p = std::max(window_.sigma_p, s.sigma_p.maxCoeff());
  if (window_.length < kWindow) return;
  const double seconds = window_.length.seconds();
  const double error_m = (window_.moved - window_.integral).norm();
  const double most_m =
      std::max(kLeastPosition_m, window_.sigma_p) + kSdMost * std::max(kLeastVelocity_m_s, window_.sigma_v) * seconds;
  book.judge(Rule::kVelocity, error_m <= most_m, s.arrival, [&] {
    const Vec3 m = window_.moved, v = window_.integral;
    return fmt::format(
        "in {:.2f} s positions moved by ({:.2f}, {:.2f}, {:.2f}) m, velocities by ({:.2f}, {:.2f}, {:.2f})", seconds,
        m.x(), m.y(), m.z(), v.x(), v.y(), v.z());
  });
  largest_velocity_error_m_s_ = std::max(largest_velocity_error_m_s_, error_m / seconds);
  book.figure(Rule::kVelocity, fmt::format("off by up to {:.3f} m/s over half a second", largest_velocity_error_m_s_));
  window_ = {};
}

}  // namespace epiline::hil
