#pragma once
// The settings of an estimator, and the states it may be started from.
#include <array>
#include <cstddef>
#include <cstdint>

#include "estimator/geometry/types.h"
#include "estimator/inertial/imu_noise.h"

namespace epiline {

enum class VisualFactor : std::uint8_t { kTrack, kEpipolar, kReprojection };
/// What they are called outside, in the order of the enum: the one list of all visual factors.
inline constexpr std::array kVisualFactorNames = {"track", "epipolar", "reprojection"};
constexpr const char* to_string(VisualFactor factor) noexcept {
  return kVisualFactorNames[static_cast<std::size_t>(factor)];
}

enum class KeyframeRule : std::uint8_t { kCompensatedParallax, kRawParallax /* VINS-Mono's */ };

/// Where the camera sits and how it is clocked.
struct Extrinsics {
  Mat3 R_BC = Mat3::Identity();
  Vec3 p_BC = Vec3::Zero();
  double focal_px = 458;     ///< pixels per radian: converts thresholds in pixels to angles
  double time_offset_s = 0;  ///< first guess of t_IMU - t_image
};

/// What the wheels of a ground vehicle measure: the speed of a point of it along its forward axis.
struct WheelModel {
  bool use = true;                 ///< false: speeds are left out
  Vec3 forward_B = Vec3::UnitX();  ///< that axis, in the IMU's
  Vec3 p_BV = Vec3::Zero();        ///< that point, seen from the IMU: the middle of the axle that does not steer
  double sigma_m_s = 0.05;
  double cauchy = 2;  ///< kernel scale, in sigmas: a wheel that slips
};

struct EstimatorConfig {
  VisualFactor visual_factor = VisualFactor::kTrack;
  int keyframes = 10;             ///< older frames in the window, 2 to 20
  double solve_interval_s = 0.1;  ///< images in between are predicted only
  int steps = 1;                  ///< accepted solver steps a frame at most
  int steps_young = 3;            ///< the same while the window is young or after a rejected step
  // visual noise
  double pixel_sigma = 0.5;          ///< first guess and, if not estimated, the value
  bool estimate_pixel_sigma = true;  ///< from the residuals' median, 0.3 to 2 px
  double sigma_inflation = 1.5;      ///< scale of the covariance over the scale of the kernel (correlated tracks)
  double cauchy = 2;                 ///< kernel scale, in kernel sigmas
  bool gate = true;
  double gate_cap = 0.4;  ///< a frame that would gate a larger share gates nothing
  // inertial noise
  ImuNoise imu;
  double gyroscope_density_factor = 3;  ///< covers scale and misalignment errors
  double accelerometer_density_factor = 1;
  double saturation_gyroscope_rad_s = 1e9, saturation_accelerometer_m_s2 = 1e9;
  // window policy
  KeyframeRule keyframe_rule = KeyframeRule::kCompensatedParallax;
  double keyframe_parallax_px = 10;
  bool zero_motion = true;
  // online calibration
  bool estimate_time_offset = true;
  double time_offset_sigma_s = 5e-3;
  bool estimate_extrinsics = false;
  double extrinsic_rotation_sigma_rad = 0.0087, extrinsic_translation_sigma_m = 5e-3;
  Extrinsics extrinsics;
  WheelModel wheel;  ///< of speeds, if any come
};

/// A complete initial state with standard deviations, for starts from known conditions.
struct InitialState {
  Vec3 p_WB = Vec3::Zero(), v_WB = Vec3::Zero(), b_a = Vec3::Zero(), b_g = Vec3::Zero();
  Mat3 R_WB = Mat3::Identity();
  double sigma_p = 1e-3, sigma_tilt = 0.01, sigma_yaw = 1e-3, sigma_v = 0.05, sigma_b_a = 0.05, sigma_b_g = 0.003;
};

}  // namespace epiline
