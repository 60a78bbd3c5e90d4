#pragma once
// The estimator from outside: IMU samples and tracked frames in, odometry out. Mathematics only: no clock, thread, file
// or, after construction, heap.
#include <array>
#include <cstdint>
#include <memory>

#include "estimator/geometry/types.h"
#include "estimator/inertial/preintegration.h"
#include "platform/samples/samples.h"

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

/// What the estimator may ask of the outside while it works. Both calls must return at once.
class Supervisor {
 public:
  enum class Phase : std::uint8_t { kNone, kSolve, kMarginalise };
  /// What a frame may cost.
  struct Effort {
    bool solve = true;    ///< false: the IMU predicts this frame
    int most_tracks = 0;  ///< in the solve and in what leaves the window; 0: all
    int most_steps = 0;   ///< 0: as configured; 1: one step, accepted without being tried
    bool reduced() const { return !solve || most_tracks > 0 || most_steps > 0; }
  };
  virtual ~Supervisor() = default;
  /// Asked once for each frame that is due to be solved. Starts are not asked for: they take what they need.
  virtual Effort effort() noexcept { return {}; }
  /// Asked between solver steps; true: there is no time for another, return the best accepted iterate now.
  virtual bool time_is_up() noexcept { return false; }
  /// The phase that begins now (kNone: bookkeeping), for whoever measures time.
  virtual void phase(Phase) noexcept {}
};

/// A complete initial state with standard deviations, for starts from known conditions.
struct InitialState {
  Vec3 p_WB = Vec3::Zero(), v_WB = Vec3::Zero(), b_a = Vec3::Zero(), b_g = Vec3::Zero();
  Mat3 R_WB = Mat3::Identity();
  double sigma_p = 1e-3, sigma_tilt = 0.01, sigma_yaw = 1e-3, sigma_v = 0.05, sigma_b_a = 0.05, sigma_b_g = 0.003;
};

enum class StartKind : std::uint8_t { kNone, kGiven, kStationary, kMoving };

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

struct EstimatorStats {
  // frames = solved + predicted + without_pose + refused; predicted_for_time of the predicted ones were due for a solve
  std::uint64_t frames = 0, frames_solved = 0, frames_predicted = 0, frames_without_pose = 0, frames_refused = 0;
  std::uint64_t frames_predicted_for_time = 0;
  std::uint64_t solves = 0;  ///< over which the next four are summed
  std::uint64_t imu_samples = 0, imu_out_of_order = 0, imu_duplicate = 0, imu_not_finite = 0, imu_saturated = 0,
                imu_gaps = 0;
  std::uint64_t iterations = 0, residuals = 0, state_size = 0, deadline_hits = 0;
  std::uint64_t linearisations = 0, tracks_offered = 0, tracks_used = 0;  ///< likewise
  std::uint64_t keyframes = 0, zero_motion_frames = 0, gated = 0, gate_suspended = 0, tracks_refused = 0;
  std::uint64_t wheel_samples = 0, wheel_refused = 0, wheel_frames = 0;  ///< wheel_frames: frames that got a speed
  std::uint64_t resets = 0, start_attempts = 0;
  std::uint64_t start_refused[static_cast<int>(StartRefusal::kCount)] = {};
  StartKind start_kind = StartKind::kNone;
  double pixel_sigma = 0;
};

struct StepResult {
  bool has_pose = false;  ///< `odometry()` holds an estimate for this frame
  bool solved = false;    ///< otherwise predicted with the IMU
  bool keyframe = false;
};

class Estimator {
 public:
  /// Allocates everything it will ever use.
  explicit Estimator(const EstimatorConfig& config);
  ~Estimator();
  Estimator(const Estimator&) = delete;
  Estimator& operator=(const Estimator&) = delete;

  /// IMU readings in time order; bad ones (old, doubled, not finite) are counted and left out. False: left out.
  bool add_imu(const ImuSample& sample) noexcept;
  /// A speed of the wheels, in time order; bad ones are left out: false. It serves the frames whose time lies between
  /// this one and the one before, if they are still in the window: so a speed may come late, and none is waited for.
  bool add_wheel(const WheelSample& sample) noexcept;
  /// The IMU time up to which readings must have been added before a frame of this stamp is processed: the frame's,
  /// less a fifth of an IMU interval. A frame just past a reading need not wait for the next one: the last one holds so
  /// long.
  HostStamp imu_needed_until(HostStamp image) const noexcept;
  /// One image's tracks, in time order.
  StepResult process(const TrackedFrame& frame, Supervisor& supervisor) noexcept;
  /// Starts (or starts anew) at this frame from a known state, without any search.
  void start(const TrackedFrame& frame, const InitialState& state) noexcept;

  const Odometry& odometry() const noexcept;
  const EstimatorStats& stats() const noexcept;
  /// Current bias estimate for the tracker's prediction; zero before the start.
  Vec3 gyroscope_bias() const noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace epiline
