#pragma once
// What a fit of a motion to a recorded flight found, and how well it agrees with what it was made from.
#include <cstddef>
#include <string>
#include <vector>

#include "drivers/laboratory/simulate/motion_agreement.h"
#include "estimator/geometry/types.h"

namespace epiline {

struct FitReport {
  double duration_s = 0, knot_interval_s = 0;
  int iterations = 0;
  double seconds = 0;  ///< the fit took
  // the ground truth
  std::size_t poses = 0;
  double longest_gap_s = 0;
  double position_rms_m = 0, position_p95_m = 0, rotation_rms_rad = 0, rotation_p95_rad = 0;
  double distrusted_share = 0;  ///< poses that the robust weight takes for less than a quarter
  // the constants, see FitSettings
  double tilt_rad = 0, time_offset_s = 0;  ///< t_IMU = t_truth + time_offset
  Vec3 mount_rad = Vec3::Zero();           ///< rotation vector of R_BM, M the body of the truth
  Vec3 p_BM = Vec3::Zero();
  Vec3 gyroscope_bias = Vec3::Zero(), accelerometer_bias = Vec3::Zero();  ///< half way
  double gyroscope_bias_range = 0, accelerometer_bias_range = 0;          ///< largest minus smallest, worst axis
  // the agreement with the IMU
  SampleAgreement samples;
  std::vector<IntegratedAgreement> integrated;  ///< over 0.1, 0.5, 1 and 2 s
};

/// For a person: some ten lines.
std::string text_of(const FitReport& report);
/// The same, for a program: one JSON object, SI units.
std::string json_of(const FitReport& report);

}  // namespace epiline
