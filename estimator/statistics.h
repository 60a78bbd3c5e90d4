#pragma once
// What the estimator counts, and why it refuses to start.
#include <array>
#include <cstdint>

#include "platform/samples/samples.h"

namespace epiline {

enum class StartKind : std::uint8_t {
  kNone,
  kGiven,
  kStationary,
  kMoving,
  kCarried,  ///< from the state that the IMU carried over a silence
};

/// Why a start was refused; the index of EstimatorStats::start_refused.
enum class StartRefusal : std::uint8_t {
  kTooFewFrames,
  kTooFewTracks,
  kNoImu,
  kNoParallax,
  kSolverFailed,
  kResidualTooLarge,
  kTiltUncertain,
  kVelocityUncertain,
  kScaleUncertain,
  kBiasImplausible,
  kCount
};
const char* to_string(StartRefusal);

/// The frame that gave the world its origin and heading at a start: its position and yaw have no error by definition,
/// and the covariances published are relative to it. It is older than the first pose published.
struct WorldOrigin {
  bool known = false;
  std::uint32_t reset_counter = 0;  ///< of the odometry that is relative to it
  HostStamp stamp;                  ///< IMU's time
  std::array<double, 3> p_WB_m{};
  std::array<double, 4> q_WB{1, 0, 0, 0};  ///< Hamilton, w x y z
};

struct EstimatorStats {
  // frames = solved + predicted + without_pose + refused; predicted_for_time of the predicted ones were due for a solve
  std::uint64_t frames = 0, frames_solved = 0, frames_predicted = 0, frames_without_pose = 0, frames_refused = 0;
  std::uint64_t frames_predicted_for_time = 0;
  std::uint64_t solves = 0;  ///< over which the next four are summed
  std::uint64_t imu_samples = 0, imu_out_of_order = 0, imu_duplicate = 0, imu_not_finite = 0, imu_saturated = 0,
                imu_gaps = 0;
  std::uint64_t imu_impossible = 0;                ///< values that no sensor measures: left out
  std::uint64_t imu_far_ahead = 0;                 ///< stamps more than 0.25 s ahead, kept aside until the next reading
  std::uint64_t imu_suspect = 0, imu_bridged = 0;  ///< unlike the reading before; of those, unlike the next one, too
  std::uint64_t iterations = 0, residuals = 0, state_size = 0, deadline_hits = 0;
  std::uint64_t linearisations = 0, tracks_offered = 0, tracks_used = 0;  ///< likewise
  std::uint64_t keyframes = 0, zero_motion_frames = 0, gated = 0, gate_suspended = 0, tracks_refused = 0;
  std::uint64_t wheel_samples = 0, wheel_refused = 0, wheel_frames = 0;  ///< wheel_frames: frames that got a speed
  std::uint64_t features_refused = 0;                                    ///< whose bearing or Jacobian no camera gives
  std::uint64_t solver_failures = 0;  ///< solves that gave up or met a number that is not finite
  std::uint64_t resets = 0, carried_starts = 0, start_attempts = 0;
  std::uint64_t start_refused[static_cast<int>(StartRefusal::kCount)] = {};
  StartKind start_kind = StartKind::kNone;
  double pixel_sigma = 0;
  std::array<WorldOrigin, 8> origins;  ///< of the newest starts, at reset_counter modulo their number
};

}  // namespace epiline
