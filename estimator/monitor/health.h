#pragma once
// Health of the estimate, from its posterior, tracks, gate and solver steps. States and limits:
// docs/derivations/health.md.
#include "estimator/statistics.h"
#include "platform/samples/samples.h"

namespace epiline {

/// Evidence from one frame.
struct FrameEvidence {
  bool solved = false;  ///< otherwise predicted only
  bool finite = true;
  int tracks = 0;          ///< seen in this frame
  double gated_share = 0;  ///< of the window's tracks
  bool steps_rejected = false;
  bool deadline_missed = false;
  bool overloaded = false;                            ///< solved with less than the configured effort
  bool imu_gap = false;                               ///< or shortly after one
  bool readings_refused = false;                      ///< or shortly after: the images contradict them
  Severity numbers_wrong = Severity::kNone;           ///< calibration, units or time offset: suspicion.h
  bool number_named = true;                           ///< else something that moves contradicts them, or a blow
  double speed = 0;                                   ///< m/s
  double sigma_velocity = 0;                          ///< m/s, largest axis
  double sigma_tilt = 0;                              ///< rad
  double bias_accelerometer = 0, bias_gyroscope = 0;  ///< norms, m/s^2, rad/s
  double innovation = 0;                              ///< of the images against the IMU's prediction: evidence.h
  double parallax_px = 0;                             ///< over the window: keyframe.h
  bool at_rest = false;                               ///< nothing moves, so no parallax is missed
};

/// The one place where health is decided.
class HealthMonitor {
 public:
  const Health& health() const { return health_; }
  /// There is no state. What follows a flight that failed is doubted until it has lasted a few seconds: what was wrong
  /// may still be.
  void restart();
  /// There is one. `carried`: it goes on from one that was good enough, and is worth what its covariance says.
  void begin(bool carried);
  /// Adds the evidence of a solved frame.
  void update(const FrameEvidence& e, double dt_s);
  /// What keeps a frame that is not solved from being good.
  void say(HealthReason reason);
  /// The posterior has been tight once since the start.
  bool settled() const { return settled_; }
  /// What was known is worth going on from.
  bool trusts() const { return health_.state == HealthState::kTracking || health_.state == HealthState::kDegraded; }
  /// True if the state cannot recover: restart.
  bool reset_wanted() const { return reset_wanted_; }
  /// What made it fail passes: the next flight is not doubted for it.
  void forgive() { reset_wanted_ = false; }
  /// The flight failed for a reason that its evidence does not hold.
  void want_reset() { reset_wanted_ = true; }

 private:
  Health health_{HealthState::kInitialising, static_cast<std::uint32_t>(HealthReason::kNoInitialState), 0};
  bool settled_ = false;  ///< the posterior has been tight once
  double lost_s_ = 0, gated_s_ = 0, unsettled_s_ = 0, doubted_s_ = 0;
  int rejected_frames_ = 0;
  double quality_ = 0;
  bool reset_wanted_ = false;
};

}  // namespace epiline
