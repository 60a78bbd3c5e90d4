#pragma once
// Input and result of a moving start. Frame 0 is the oldest; all results are in the body frame B_0 of frame 0.
#include <array>
#include <cstdint>
#include <span>

#include "estimator/geometry/types.h"
#include "estimator/inertial/preintegration.h"
#include "estimator/initialise/start_kernels.h"

namespace epiline {

inline constexpr double kGravity = 9.81;  ///< m/s^2

/// One feature: in which frames it was seen (ascending) and its unit bearings there, in the camera frame.
struct StartTrack {
  int count = 0;
  std::array<std::uint8_t, kStartFrames> frame;
  std::array<Vec3, kStartFrames> f_C;
};

struct StartProblem {
  int frames = 0;                                ///< at most kStartFrames
  std::array<std::uint64_t, kStartFrames> id{};  ///< of each frame, never reused; 0: unknown
  const Preintegration* interval = nullptr;      ///< [k]: frame k -> k + 1, linearised at (b_a = 0, b_g_ref)
  std::span<const StartTrack> tracks;            ///< tracks beyond kStartTracks are not used
  Mat3 R_BC = Mat3::Identity();
  Vec3 p_BC = Vec3::Zero();
  double sigma_rad = 1e-3;  ///< bearing noise, rad
  Vec3 b_g_ref = Vec3::Zero();
  double b_g_sigma = 0.1;       ///< rad/s: standard deviation of the gyroscope bias around b_g_ref
  double b_a_sigma = 0.1;       ///< m/s^2: standard deviation of the accelerometer bias around zero
  Vec3 v_0_ref = Vec3::Zero();  ///< the velocity that is known beside images and IMU, and its information; of nothing
  Mat3 v_0_information = 0.01 * Mat3::Identity();  ///< but what an aircraft can do, it only keeps the system regular
};

/// The state at frame 0. Together with the IMU samples it determines the whole path.
struct StartState {
  Vec3 v_0 = Vec3::Zero();           ///< m/s
  Vec3 g_0 = Vec3(0, 0, -kGravity);  ///< gravity, |g_0| = kGravity
  Vec3 b_g = Vec3::Zero(), b_a = Vec3::Zero();
};

}  // namespace epiline
