#pragma once
// Camera and IMU as one rig: the constants that explain corners and readings best, with what they are good to.
// Method: docs/derivations/rig.md.
#include <cmath>
#include <vector>

#include "drivers/study/calibrate/lens_fit.h"
#include "drivers/study/calibrate/rig_state.h"
#include "drivers/study/calibrate/turn_alignment.h"
#include "platform/error/result.h"
#include "platform/samples/samples.h"

namespace epiline {

/// Standard deviations of the measurements about the fit.
struct RigNoise {
  double corner_px = 0.5;        ///< each image coordinate
  double gyroscope = 0;          ///< of a reading, each axis, rad/s
  double accelerometer = 0;      ///< m/s^2
  double gyroscope_density = 0;  ///< the same as densities, which the estimator takes
  double accelerometer_density = 0;
};

/// A corner and how far it is from where the fit has it.
struct CornerError {
  double t_s;
  std::uint32_t id;
  Vec2 px, e_px;
};

/// Rows and columns: the constants in the order of RigColumns(0, model); rotations as right perturbations, gravity in
/// rad across it.
struct RigUncertainty {
  /// If some lens of the model has the true one's shape.
  Eigen::MatrixXd covariance;
  /// Where corners tell that none has, one or two columns: how far the constants would move if the lens had the
  /// lens_terms() too, and behind these numbers those of the terms. Each column counts as one sigma.
  Eigen::MatrixXd misfit;
  double sigma(int column) const;
};

struct RigFit {
  RigState state;
  RigNoise noise;
  RigUncertainty uncertainty;
  std::vector<CornerError> corners;
  double rms_px = 0;  ///< of the corners' distances, as calibrations are usually judged; outliers left out
  std::size_t views = 0, outliers = 0;
  /// How much larger the board is than described, by the accelerometer: logarithm of the scale, and its sigma. Where it
  /// cannot be as described, the board of the fit has this scale, else 1.
  double board_size = 0, board_size_sigma = 0;
  bool is_board_as_described() const { return state.constants.shape.scale == 1; }
  double sigma(int column) const { return uncertainty.sigma(column); }
  /// Of a vector, from that column on.
  Vec3 sigmas(int column) const { return {sigma(column), sigma(column + 1), sigma(column + 2)}; }
};

struct RigFitSettings {
  ImuNoise noise;  ///< its random walks are used; its densities are where the iteration starts
  double bias_interval_s = 5;
  bool hold_lens = false;
};

/// Fails if and only if less than kShortest_s of motion is seen by both, or the fit does not converge.
Result<RigFit> fit_rig(const std::vector<CornerView>& views, const LensFit& lens, const TurnAlignment& turns,
                       const std::vector<ImuSample>& imu, const RigFitSettings& settings);

inline constexpr double kShortestRig_s = 5;

}  // namespace epiline
