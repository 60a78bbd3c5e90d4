#pragma once
// What all parts of the estimator see.
#include "estimator/config.h"
#include "estimator/inertial/imu_history.h"
#include "estimator/inertial/nav_state.h"
#include "estimator/parts/noise.h"
#include "estimator/statistics.h"
#include "estimator/window/window.h"

namespace epiline {

/// s: a younger state may be far off, so there is no gate; so long is the speed in doubt after readings that are
/// missing or contradicted.
inline constexpr double kGateFree_s = 1;

/// A state with its covariance at an instant of the IMU. The only thing that survives a reset.
struct KnownState {
  bool known = false;    ///< false before the first start
  bool trusted = false;  ///< the estimator was healthy there: attitude and velocity are worth going on from
  HostStamp time;
  NavState x;
  Vec3 omega = Vec3::Zero();                    ///< rad/s, bias included
  StateCovariance P = StateCovariance::Zero();  ///< in the window's world
  CrossCovariance with_calibration = CrossCovariance::Zero();
};

struct Common {
  explicit Common(const EstimatorConfig& c);
  Common(const Common&) = delete;
  Common& operator=(const Common&) = delete;

  Calibration configured_calibration() const {
    return {config.extrinsics.time_offset_s, config.extrinsics.R_BC, config.extrinsics.p_BC, 0, 0, {}};
  }

  const EstimatorConfig config;
  EstimatorStats stats;
  ImuHistory history;
  Noise noise;
  Window window;
  bool started = false;  ///< the window's frames have states
  KnownState carried;    ///< the newest frame solved, or carried on from there by the IMU
  CalibrationCovariance calibration_covariance = CalibrationCovariance::Zero();  ///< by the last solve; 0: none yet
  CalibrationTangent prior_information = CalibrationTangent::Zero();        ///< in that, of the calibration's own prior
  CalibrationCovariance calibration_doubt = CalibrationCovariance::Zero();  ///< G of calibration_prior.h, by that
};

}  // namespace epiline
