#pragma once
// Finds configured numbers that the flight contradicts. Derivation: docs/derivations/turns.md; texts:
// pipeline/text/suspicion_text.h.
#include <array>
#include <cstdint>

#include "estimator/inertial/imu_noise.h"
#include "estimator/monitor/contradiction.h"
#include "estimator/monitor/turn_watch.h"
#include "estimator/statistics.h"

namespace epiline {

/// By how much a lens that is not as configured shows turns larger, over the image.
struct Magnified {
  double least = 1, most = 1;
};

/// Suspicions from camera and gyroscope: of the configured rotation and time offset, and of the gyroscope's units and
/// axes. The other rows are clear. `R_BC`, `time_offset_s`: the configured values. `lens`: the estimated one;
/// `gyroscope_ratio`: estimated rates over those read. A ratio of rates that they explain raises no suspicion.
Suspicions suspicions_of(const TurnAgreement& turns, const Mat3& R_BC, double time_offset_s, const Magnified& lens = {},
                         double gyroscope_ratio = 1) noexcept;

/// Suspicion of the focal length: a note if the flight estimated another one, more than a note if it is far off.
void add_focal_length(double ratio, double sigma, Suspicions& suspicions) noexcept;
/// The same of its shape, by the radius in the image 45 degrees off the axis.
void add_lens_shape(double ratio, double sigma, Suspicions& suspicions) noexcept;

/// How far the camera's pose on the IMU that the flight estimates is from the configured one, and the standard
/// deviations of that, 0: not estimated.
struct FoundPose {
  double rotation_rad = 0, rotation_sigma = 0, place_m = 0, place_sigma = 0;
};
/// Suspicion of that pose. Where turns show the rotation, they have named it before.
void add_pose(const FoundPose& found, Suspicions& suspicions) noexcept;

/// The same of a scale of the IMU. `suspect`: which one.
void add_imu_scale(Suspect suspect, double ratio, double sigma, Suspicions& suspicions) noexcept;

/// Notes on noise densities that the samples contradict. `used`: the densities that replaced the configured ones.
void add_suspicions(const ImuNoise& configured, const ImuNoise& used, Suspicions& suspicions) noexcept;

/// `pair_px`: the tracks' error between two images, which does not depend on the IMU (TurnWatch::noise_rad()).
void add_contradictions(const ContradictionWatch& watch, double pair_px, Suspicions& suspicions) noexcept;

/// Mean lengths of specific force and angular rate over the last five seconds. In any flight the first stays near
/// 9.8 m/s^2. The second stays far below the value that rates in degrees per second would give.
class UnitsWatch {
 public:
  void add(const ImuSample& reading) noexcept;
  double force_m_s2() const noexcept { return force_; }  ///< 0: less than five seconds of samples
  double rate_rad_s() const noexcept { return rate_; }

 private:
  HostStamp begin_;
  double force_sum_ = 0, rate_sum_ = 0, force_ = 0, rate_ = 0;
  int count_ = 0;
};

void add_suspicions(const UnitsWatch& units, Suspicions& suspicions) noexcept;

/// True if a mean specific force at rest, m/s^2, can be gravity plus a bias.
bool can_be_gravity(double force_m_s2) noexcept;

}  // namespace epiline
