#pragma once
// Whether the user's numbers can be true. Derivation: docs/derivations/turns.md.
#include "estimator/monitor/contradiction.h"
#include "estimator/monitor/suspicion.h"
#include "estimator/monitor/turn_watch.h"
#include "estimator/monitor/wheel_watch.h"
#include "estimator/parts/common.h"

namespace epiline {

class RigNumbers {
 public:
  explicit RigNumbers(Common& common);
  void add(const ImuSample& reading);
  /// Of every image that is due for a solve.
  void watch(const TrackedFrame& frame, const WheelWatch& wheels);
  /// What the solved window's residuals say: whether images and IMU contradict each other.
  void add(const TrackFit& tracks, double imu_chi2, double dt_s, double parallax_px, bool settled);
  /// How wrong the numbers are by the present verdict.
  Severity wrong() const { return wrong_; }
  /// Whether a number is accused; otherwise what contradicts is something that moves, or a blow.
  bool is_named() const { return named_; }
  /// The same without turns that are unrelated: what the camera saw while it was handled says nothing of a rest.
  Severity wrong_at_rest() const { return wrong_at_rest_; }
  /// Motion of this flight has fitted: what contradicts now is something that moves, or a blow.
  bool have_fitted() const { return contradictions_.numbers_fitted(); }
  /// At rest it reads a force that cannot be gravity.
  void refuse_force(double force_m_s2);
  /// It starts at rest: how it turned while it was handled is no reason to doubt it.
  void stands();
  /// Readings that were refused, or stamps that have slipped, are among what was compared.
  void forget_turns() { turns_.forget(); }
  /// The IMU's noise was not what it was judged by.
  void forgive_imu() { contradictions_.forget_imu(); }
  /// After a reset; contradictions are remembered, since they are the rig's.
  void restart() { contradictions_.restart(); }

 private:
  FoundPose found_pose() const;
  /// By the configured numbers, and by those that the flight has corrected.
  struct Both {
    Suspicions said, left;
  };
  Both by_sensors() const;
  void add_found(Both& both, const WheelWatch& wheels) const;

  Common& common_;
  TurnWatch turns_;
  UnitsWatch units_;
  ContradictionWatch contradictions_;
  HostStamp judged_at_;
  Severity contradiction_judged_ = Severity::kNone;
  Severity wrong_ = Severity::kNone, wrong_at_rest_ = Severity::kNone;
  bool named_ = false;
};

}  // namespace epiline
