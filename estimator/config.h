#pragma once
// Settings of the estimator, and a known state to start from. Those that a user may set are in
// pipeline/config/parameters.cc, with ranges and units; studies set the others here.
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "estimator/geometry/types.h"
#include "estimator/inertial/imu_noise.h"
#include "estimator/simd/instruction_set.h"
#include "platform/samples/samples.h"

namespace epiline {

class VisualFactorModel;

/// What turns tracks into residuals. Only comparisons set another one than the estimator's own
/// (drivers/laboratory/factors).
struct VisualFactor {
  const char* name = "track";                                                ///< in results
  std::unique_ptr<VisualFactorModel> (*make)(InstructionSet set) = nullptr;  ///< null: TrackFactor
};

/// Pose of the camera on the IMU, and time offset of its images. x_B = R_BC x_C + p_BC.
struct Extrinsics {
  Mat3 R_BC = Mat3::Identity();
  Vec3 p_BC = Vec3::Zero();
  double focal_px = 458;     ///< pixels per radian; converts thresholds from pixels to angles
  double time_offset_s = 0;  ///< initial t_IMU - t_image
  double readout_s = 0;      ///< rolling shutter: exposure of the last row minus that of the first
};

/// A camera beside the first one; all are mounted rigidly. x_B = R_BC x_C + p_BC.
struct OtherCamera {
  bool use = false;  ///< false: what it sees is ignored
  Mat3 R_BC = Mat3::Identity();
  Vec3 p_BC = Vec3::Zero();
  double readout_s = 0;  ///< as that of Extrinsics
  double apart_s = 0;    ///< its images are taken up to so much before or after the first one's; 0: at the same time
};

/// The measurement of the wheels of a ground vehicle: the speed of a point of the vehicle along its forward axis.
struct WheelModel {
  bool use = true;                 ///< false: ignore speeds
  Vec3 forward_B = Vec3::UnitX();  ///< unit vector of the forward axis
  Vec3 p_BV = Vec3::Zero();        ///< the point, m: the middle of the non-steering axle
  double sigma_m_s = 0.05;         ///< standard deviation of a speed's white noise
  double scale_sigma = 0.03;       ///< relative: of what the wheels read too much or too little for long
  double sideways_sigma_m_s = 0;   ///< of the speed sideways and upwards; 0: nothing is known of it
};

/// A height sensor. Its readings have white noise and an offset that walks: a barometer's with the weather and the
/// wind, a range finder's with the ground below (docs/derivations/height.md).
struct HeightModel {
  bool use = true;                            ///< false: ignore its samples
  double sigma_m = 0.2;                       ///< standard deviation of the white noise
  double walk_per_root_s = 0;                 ///< random walk of the offset, m per root of a second
  double walk_per_root_m = 0;                 ///< the same, m per root of a metre of horizontal way
  std::array<double, 2> limits_m{-1e5, 1e5};  ///< readings beyond are left out
  Vec3 p_BS = Vec3::Zero();                   ///< the sensor's place, m
  Vec3 beam_B = Vec3::Zero();                 ///< range finder: unit vector of the beam's direction
};
using HeightModels = std::array<HeightModel, kHeightKinds>;
inline HeightModels usual_heights() {
  HeightModel barometer, range;
  barometer.walk_per_root_s = 0.1;
  range.sigma_m = 0.1;
  range.walk_per_root_m = 0.05;
  range.limits_m = {0.1, 100};
  range.beam_B = -Vec3::UnitZ();
  return {barometer, range};
}

/// Error model of a track's views. White: independent errors, as from a detector that searches each image anew. Drift:
/// a random walk, as from a tracker that works from image to image (docs/derivations/drift.md).
enum class TrackNoiseModel : std::uint8_t { kWhite, kDrift };
inline constexpr std::array kTrackNoiseNames = {"white", "drift"};

struct EstimatorConfig {
  VisualFactor visual_factor;
  int keyframes = 10;             ///< number of older frames in the window, 2 to 20
  double solve_interval_s = 0.1;  ///< images in between are predicted by the IMU
  int steps = 1;                  ///< largest number of accepted solver steps per frame
  // visual noise
  double pixel_sigma = 0.5;          ///< initial value if estimated, else the value
  bool estimate_pixel_sigma = true;  ///< from the median of the residuals, 0.3 to 2 px
  double sigma_inflation = 1.5;      ///< ratio of the sigmas of covariance and kernel, because tracks are correlated
  double cauchy = 2;                 ///< scale of the Cauchy kernel, in sigmas of the kernel
  TrackNoiseModel track_noise = TrackNoiseModel::kDrift;  ///< a start assumes white noise, which uses one camera only
  double drift_inflation = 2;  ///< ratio of the sigmas of covariance and weights, because tracks share errors
  double drift_student = 2;    ///< degrees of freedom of a drifting track's weight
  double gate_cap = 0.4;       ///< tracks that contradict the motion are left out, unless they are a larger share
  // inertial noise
  ImuNoise imu;
  double gyroscope_density_factor = 3;  ///< factor on the noise density, for scale and axis errors
  double accelerometer_density_factor = 1;
  double accelerometer_walk_factor = 2;  ///< factor on the random walk: in flight it is faster than on a table
  double saturation_gyroscope_rad_s = 1e9, saturation_accelerometer_m_s2 = 1e9;
  // window policy
  double keyframe_parallax_px = 10;
  bool zero_motion = true;
  // online calibration
  bool estimate_time_offset = true;
  double time_offset_sigma_s = 5e-3;
  bool estimate_extrinsics = true;
  double extrinsic_rotation_sigma_rad = 0.9e-3, extrinsic_translation_sigma_m = 5e-4;
  bool estimate_focal_length = true;  ///< and the shape of the lens; needs their columns in the factor
  double focal_length_sigma = 3e-4;   ///< relative; of the shape 32 degrees off the axis
  bool estimate_imu_scale = true;     ///< one factor for all axes of a sensor
  double accelerometer_scale_sigma = 1e-3, gyroscope_scale_sigma = 1e-3;  ///< relative
  Extrinsics extrinsics;
  std::array<OtherCamera, kMostOthers> others;  ///< cameras 1 to 3
  WheelModel wheel;                             ///< used if speeds arrive
  HeightModels heights = usual_heights();       ///< of each HeightKind; used if samples arrive
};

/// A known initial state with standard deviations; SI units. W: z up, B: the IMU.
struct InitialState {
  Vec3 p_WB = Vec3::Zero(), v_WB = Vec3::Zero(), b_a = Vec3::Zero(), b_g = Vec3::Zero();
  Mat3 R_WB = Mat3::Identity();
  double sigma_p = 1e-3, sigma_tilt = 0.01, sigma_yaw = 1e-3, sigma_v = 0.05, sigma_b_a = 0.05, sigma_b_g = 0.003;
};

/// The noise that intervals between frames are integrated with.
inline ImuNoise in_flight(const EstimatorConfig& config, ImuNoise noise) noexcept {
  noise.gyroscope_density *= config.gyroscope_density_factor;
  noise.accelerometer_density *= config.accelerometer_density_factor;
  noise.accelerometer_random_walk *= config.accelerometer_walk_factor;
  return noise;
}

}  // namespace epiline
