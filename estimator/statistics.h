#pragma once
// Counters of the estimator, and reasons for refused starts.
#include <array>
#include <cstdint>

#include "platform/samples/samples.h"

namespace epiline {

enum class StartKind : std::uint8_t {
  kNone,
  kGiven,
  kStationary,
  kMoving,
  kCarried,  ///< from the state that the IMU predicted during a silence of the camera
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
  kNumbersWrong,  ///< a gross suspicion: see Suspicions
  kCount
};
const char* to_string(StartRefusal);

/// Numbers of the user that the flight can contradict; the index of Suspicions.
enum class Suspect : std::uint8_t {
  kRotation,        ///< of the camera on the IMU; figure: rad between the configured and the seen one
  kInverted,        ///< its inverse would agree instead; figure: rad that would remain
  kPlace,           ///< of the camera on the IMU; figure: m between the configured and the estimated one
  kMirrored,        ///< an axis has the wrong sign, or two are swapped; figure: agreement after that is put right
  kTimeOffset,      ///< figure: s to add to the configured t_IMU - t_image
  kGyroscopeUnits,  ///< figure: the gyroscope's rates over the camera's; negative: minus their mean, rad/s
  kScale,  ///< of the gyroscope, or the focal length, beyond what was found of it; figure: the gyroscope's rates over
           ///< the camera's
  kUnrelated,           ///< camera and gyroscope do not turn together; figure: agreement, 1 is perfect
  kAccelerometerUnits,  ///< figure: mean length of the specific force, m/s^2
  kMisfit,     ///< images and IMU contradict each other in the window; figure: tracks' error, px per root of an image
  kImuMisfit,  ///< the images contradict the IMU beyond its noise; figure: mean square of its residuals, in their own
               ///< variance
  kBehind,     ///< tracks meet behind the camera; figure: share of them
  kGyroscopeNoise,      ///< figure: density that the readings allow, over the configured one
  kAccelerometerNoise,  ///< the same
  kFocalLength,         ///< figure: the one found, over the configured one
  kLensShape,  ///< the lens' distortion; figure: radius in the image 45 degrees off the axis, over the configured
  kAccelerometerScale,  ///< figure: what a true reading would be, over what is read
  kGyroscopeScale,      ///< the same
  kWheelScale,          ///< figure: the vehicle's speed over that of the wheels
  kWheelSlip,           ///< the wheels' speeds scatter about the vehicle's; figure: by this share of them
  kWheelStuck,          ///< they do not change with the vehicle's; figure: what they read, m/s
  kWheelDelay,          ///< figure: s by which the vehicle's speeds are ahead of theirs
  kCount
};
enum class Severity : std::uint8_t {
  kNone,
  kNote,     ///< the configuration is wrong, and the flight corrects for it
  kSuspect,  ///< the estimate may be worse than it claims
  kGross,    ///< no estimate with this number is worth anything
};
/// Of the three axes k of a sensor: along which of its axes 1, 2, 3 they should point; negative: the other way.
using TurnedAxes = std::array<std::int8_t, 3>;
struct Suspicion {
  Severity severity = Severity::kNone;
  double figure = 0;
  TurnedAxes axes{};  ///< of kMirrored
};
using Suspicions = std::array<Suspicion, static_cast<int>(Suspect::kCount)>;

/// The calibration as the flight has found it; zero sigmas: not estimated.
struct FoundCalibration {
  bool known = false;
  double time_offset_s = 0;                ///< t_IMU - t_image
  std::array<double, 4> q_BC{1, 0, 0, 0};  ///< Hamilton, w x y z
  std::array<double, 3> p_BC_m{};
  double focal_ratio = 1;      ///< over the configured focal length
  double lens_edge_ratio = 1;  ///< radius 45 degrees off the axis over the configured one, focal length aside
  double accelerometer_scale = 0, gyroscope_scale = 0;  ///< true readings over measured ones, less 1
  std::array<double, 11> sigmas{};  ///< time offset, s; rotation about the axes of C, rad; p_BC, m; the last four
};

/// The frame that defines origin and heading of the world at a start. Its position and yaw have no error by definition,
/// and published covariances are relative to it; they grow where a calibration that is found later shows that it was
/// wrong. It is older than the first published pose.
struct WorldOrigin {
  bool known = false;
  std::uint32_t reset_counter = 0;  ///< Odometry::reset_counter of the poses relative to it
  HostStamp stamp;                  ///< on the IMU's clock
  std::array<double, 3> p_WB_m{};
  std::array<double, 4> q_WB{1, 0, 0, 0};  ///< Hamilton, w x y z
};

struct EstimatorStats {
  // frames = solved + predicted + without_pose + refused. predicted_for_time: predicted frames that were due for a
  // solve.
  std::uint64_t frames = 0, frames_solved = 0, frames_predicted = 0, frames_without_pose = 0, frames_refused = 0;
  std::uint64_t frames_predicted_for_time = 0;
  std::uint64_t solves = 0;  ///< number of solves, over which iterations to tracks_used are summed
  std::uint64_t imu_samples = 0, imu_out_of_order = 0, imu_duplicate = 0, imu_not_finite = 0, imu_saturated = 0,
                imu_gaps = 0;
  std::uint64_t imu_impossible = 0;                ///< left out: values that no sensor measures
  std::uint64_t imu_far_ahead = 0;                 ///< timestamps more than 0.25 s ahead; held until the next sample
  std::uint64_t imu_suspect = 0, imu_bridged = 0;  ///< unlike the previous sample; of these, replaced
  std::uint64_t iterations = 0, residuals = 0, state_size = 0, deadline_hits = 0;
  std::uint64_t linearisations = 0, tracks_offered = 0, tracks_used = 0;
  std::uint64_t keyframes = 0, zero_motion_frames = 0, gated = 0, gate_suspended = 0, tracks_refused = 0;
  // wheel_frames: with the way from the frame before; wheel_slips: where the speeds' scale has changed.
  std::uint64_t wheel_samples = 0, wheel_refused = 0, wheel_frames = 0, wheel_slips = 0;
  // Of each HeightKind: samples taken and left out, frames with a height, jumps against the frames before.
  std::array<std::uint64_t, kHeightKinds> height_samples{}, height_refused{}, height_frames{}, height_jumps{};
  std::uint64_t features_refused = 0;  ///< with a bearing or Jacobian that no camera gives
  std::uint64_t solver_failures = 0;   ///< solves that gave up, or met a non-finite value
  std::uint64_t resets = 0, carried_starts = 0, start_attempts = 0;
  std::uint64_t start_refused[static_cast<int>(StartRefusal::kCount)] = {};
  StartKind start_kind = StartKind::kNone;
  double pixel_sigma = 0;
  Suspicions suspicions;  ///< each as severe as it ever was
  FoundCalibration calibration;
  std::array<WorldOrigin, 8> origins;  ///< of the newest starts, at index reset_counter % 8
};

}  // namespace epiline
