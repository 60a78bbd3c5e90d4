#include "estimator/monitor/health.h"

#include <algorithm>
#include <cmath>

namespace epiline {

namespace {
// settled: good enough to fly on
constexpr double kSettledVelocity = 0.1, kSettledTilt = 0.0175;  // m/s, rad
// after that, wider limits before the state is called degraded or lost
constexpr double kDegradedVelocity = 0.3, kLostVelocity = 1.0;
// Of the speed, where that is more: a scale known to that is what a fast flight can have.
constexpr double kKnownShare = 0.05, kLostShare = 0.2;
constexpr int kFewTracks = 20;
constexpr double kGatedShare = 0.4, kGatedTime_s = 1;
constexpr int kRejectedFrames = 3;
constexpr double kBiasAccelerometer = 1.5, kBiasGyroscope = 0.5;  // m/s^2, rad/s: no working sensor is that far off
constexpr double kLostBeforeReset_s = 2;
// a start that has not settled by then, or is that fast, is none
constexpr double kLongestUnsettled_s = 10, kFastestUnsettled = 60;  // s, m/s
// Numbers that end a flight show themselves in the next one, too: the tracks contradict the IMU for one second before
// that is believed.
constexpr double kDoubted_s = 5;
constexpr double kPlentyOfTracks = 60, kPlentyOfParallax_px = 10;
constexpr double kUsualInnovation = 2, kWorstInnovation = 4;
constexpr double kQualityMemory_s = 0.5;

void flag(std::uint32_t& reasons, bool on, HealthReason r) {
  if (on) reasons |= static_cast<std::uint32_t>(r);
}

/// The worst of what makes an estimate good, 0 to 1.
double share_of(const FrameEvidence& e) {
  const double tracks = e.tracks / kPlentyOfTracks;
  const double posterior = 1.3 - e.sigma_velocity / std::max(kDegradedVelocity, kKnownShare * e.speed);
  const double gate = 1 - e.gated_share;
  const double innovation = (kWorstInnovation - e.innovation) / (kWorstInnovation - kUsualInnovation);
  // without parallax the images still give rotation and the direction of travel
  const double parallax = e.at_rest ? 1 : 0.5 + 0.5 * std::min(e.parallax_px / kPlentyOfParallax_px, 1.0);
  return std::clamp(std::min({tracks, posterior, gate, innovation, parallax}), 0.0, 1.0);
}
}  // namespace

void HealthMonitor::restart() {
  const double doubted_s = reset_wanted_ ? kDoubted_s : doubted_s_;
  *this = {};
  doubted_s_ = doubted_s;
}

void HealthMonitor::begin(bool carried) {
  restart();
  settled_ = carried;
  health_.state = carried ? HealthState::kDegraded : HealthState::kInitialising;
  health_.reasons = bit(HealthReason::kPosteriorWide);
}

void HealthMonitor::say(HealthReason reason) {
  health_.reasons |= bit(reason);
  if (health_.state == HealthState::kTracking) health_.state = HealthState::kDegraded;
}

void HealthMonitor::update(const FrameEvidence& e, double dt_s) {
  if (e.solved) {
    rejected_frames_ = e.steps_rejected ? rejected_frames_ + 1 : 0;
    gated_s_ = e.gated_share > kGatedShare ? gated_s_ + dt_s : 0;
  }
  const auto within = [&e](double limit, double share) { return e.sigma_velocity < std::max(limit, share * e.speed); };
  const bool tilt = e.sigma_tilt < kSettledTilt;
  settled_ = settled_ || (tilt && within(kSettledVelocity, kKnownShare));
  const bool wide = !settled_ || !within(kDegradedVelocity, kKnownShare);

  Health h;
  flag(h.reasons, (wide && !tilt) || doubted_s_ > 0, HealthReason::kPosteriorWide);
  flag(h.reasons, wide && tilt, HealthReason::kScaleUnknown);
  doubted_s_ = std::max(0.0, doubted_s_ - dt_s);
  flag(h.reasons, e.tracks < kFewTracks, HealthReason::kFewTracks);
  flag(h.reasons, gated_s_ > kGatedTime_s, HealthReason::kManyGated);
  flag(h.reasons, rejected_frames_ >= kRejectedFrames, HealthReason::kStepsRejected);
  const bool bias = e.bias_accelerometer > kBiasAccelerometer || e.bias_gyroscope > kBiasGyroscope;
  flag(h.reasons, bias, HealthReason::kBiasImplausible);
  flag(h.reasons, e.deadline_missed, HealthReason::kDeadlineMissed);
  flag(h.reasons, e.overloaded, HealthReason::kOverloaded);
  flag(h.reasons, e.imu_gap, HealthReason::kImuGap);
  flag(h.reasons, !e.finite, HealthReason::kNotFinite);
  const bool contradicted = e.numbers_wrong > Severity::kNote;
  flag(h.reasons, contradicted && e.number_named, HealthReason::kNumbersWrong);
  flag(h.reasons, e.readings_refused || (contradicted && !e.number_named), HealthReason::kReadingsRefused);

  const bool unknown = !within(kLostVelocity, kLostShare);
  const bool lost = !e.finite || bias || unknown || e.numbers_wrong == Severity::kGross;
  // of a flight whose covariance is wide but true there is nothing better to start from, as long as there are images;
  // of a start, as long as it knows where up is
  const bool ends = e.numbers_wrong == Severity::kGross || (unknown && e.tracks < kFewTracks);
  lost_s_ = ends ? lost_s_ + dt_s : 0;
  unsettled_s_ = settled_ ? 0 : unsettled_s_ + dt_s;
  const bool failed =
      (unknown && !tilt && unsettled_s_ > kLongestUnsettled_s) || (!settled_ && e.speed > kFastestUnsettled);
  reset_wanted_ = !e.finite || bias || failed || lost_s_ > kLostBeforeReset_s;
  h.state = !settled_        ? HealthState::kInitialising
            : lost           ? HealthState::kLost
            : h.reasons != 0 ? HealthState::kDegraded
                             : HealthState::kTracking;
  quality_ += std::clamp(dt_s / kQualityMemory_s, 0.0, 1.0) * (100 * share_of(e) - quality_);
  h.quality = lost ? -1 : static_cast<int>(std::lround(quality_));
  health_ = h;
}

}  // namespace epiline
