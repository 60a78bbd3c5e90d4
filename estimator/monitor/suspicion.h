#pragma once
// What of the user's numbers cannot be true, as the flight shows it. docs/derivations/turns.md; words:
// pipeline/text/suspicion_text.h.
#include <array>
#include <cstdint>

#include "estimator/inertial/imu_noise.h"
#include "estimator/monitor/turn_watch.h"
#include "estimator/statistics.h"

namespace epiline {

/// What camera and gyroscope say of the configured rotation and time offset, and of the gyroscope's units and axes.
/// Rows of other suspects are clear. `R_BC`, `time_offset_s`: configured. `focal_ratio`: what was found of the focal
/// length, over the configured one: a ratio of rates that it explains is none.
Suspicions suspicions_of(const TurnAgreement& turns, const Mat3& R_BC, double time_offset_s,
                         double focal_ratio = 1) noexcept;

/// A focal length that the flight found to be another; far off, it is more than a note.
void add_focal_length(double ratio, double sigma, Suspicions& suspicions) noexcept;

/// Densities that the readings do not allow: `used` is what was made of the configured ones. Notes only.
void add_suspicions(const ImuNoise& configured, const ImuNoise& used, Suspicions& suspicions) noexcept;

/// `residual_px`: the tracks' error that the window's residuals show; `pair_px`: the one between two images, whatever
/// the IMU says (TurnWatch::noise_rad()).
void add_misfit(double residual_px, double pair_px, Suspicions& suspicions) noexcept;

/// Mean lengths of specific force and angular rate over the last five seconds. However one flies, the first stays near
/// 9.8 m/s^2, and the second far below what rates in degrees make of it.
class UnitsWatch {
 public:
  void add(const ImuSample& reading) noexcept;
  double force_m_s2() const noexcept { return force_; }  ///< 0: not five seconds yet
  double rate_rad_s() const noexcept { return rate_; }

 private:
  HostStamp begin_;
  double force_sum_ = 0, rate_sum_ = 0, force_ = 0, rate_ = 0;
  int count_ = 0;
};

void add_suspicions(const UnitsWatch& units, Suspicions& suspicions) noexcept;

/// Whether a mean specific force at rest, m/s^2, can be gravity's and a bias.
bool can_be_gravity(double force_m_s2) noexcept;

}  // namespace epiline
