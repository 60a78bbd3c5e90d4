#pragma once
// Models how PX4's filter treats odometry: it predicts each sample from its own state and an IMU, and rejects samples
// outside of its gates. The acceleration of the ground truth serves as the IMU. Page: docs/hil.md.
#include <optional>

#include "drivers/program/hil/rules.h"
#include "drivers/program/hil/vision_sample.h"

namespace epiline::hil {

/// The vehicle at an instant, in the recording's world (z up); B: the IMU.
struct TruthState {
  Vec3 p_WB = Vec3::Zero(), v_WB = Vec3::Zero();
  Mat3 R_WB = Mat3::Identity();
};

/// The state at a timestamp of the recording, from its ground truth; none outside of it and in its gaps.
std::optional<TruthState> truth_at(const Trajectory& truth, HostStamp recorded);

/// Three filters of position and velocity, one for each axis of the odometry's world. The heading is taken from the
/// odometry, as PX4 does with yaw fusion enabled.
class FusionModel {
 public:
  explicit FusionModel(const Mat3& R_VB) : R_VB_(R_VB) {}

  /// Timestamps must increase. A sample without ground truth is skipped; the filter restarts at the next one that has
  /// it.
  void take(const VisionSample& sample, const std::optional<TruthState>& truth, RuleBook& book);

 private:
  using Axes = Eigen::Array3d;
  /// A sample in the odometry's world with z up.
  struct Measurement {
    Axes p, v, variance_p, variance_v;
    double heading_rad = 0;  ///< of that world relative to the ground truth's
    bool has_velocity = false;
  };

  Measurement measurement_of(const VisionSample& sample, const TruthState& truth) const;
  void predict(const Measurement& m, const TruthState& truth, double dt);
  void start(const Measurement& m);
  bool passes(const Measurement& m, HostStamp at, RuleBook& book);
  void fuse(const Axes& innovation, const Axes& noise_variance, bool of_velocity);
  void judge_turn(const Measurement& m, const VisionSample& sample, bool stopped, RuleBook& book);

  Mat3 R_VB_;
  Axes p_, v_, pp_, pv_, vv_;  ///< state and covariance
  std::optional<VisionSample> newest_;
  std::optional<TruthState> newest_truth_;
  std::optional<VisionSample> newest_in_truth_;  ///< the last sample with a truth
  double newest_heading_rad_ = 0;                ///< of its world, as of Measurement
  double largest_turn_rad_ = 0;
  std::optional<HostStamp> refused_since_;
  double worst_position_ = 0, worst_velocity_ = 0;  ///< innovation over gate
};

}  // namespace epiline::hil
