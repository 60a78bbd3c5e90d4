#pragma once
// Data types that all layers share: samples, tracks, odometry, health. Plain, trivially copyable data without Eigen,
// because it travels through rings and logs.
#include <array>
#include <cstddef>
#include <cstdint>

#include "platform/memory/fixed_vector.h"
#include "platform/time/clock.h"

namespace epiline {

inline constexpr std::size_t kMaxFeatures = 400;  ///< tracks in one image

/// One IMU sample, in the body frame B. The accelerometer measures specific force: +9.81 m/s^2 upwards at rest.
struct ImuSample {
  HostStamp stamp;
  std::array<double, 3> angular_velocity_rad_s{};
  std::array<double, 3> specific_force_m_s2{};
  HostStamp arrival{};        ///< as Frame::arrival
  std::uint32_t reasons = 0;  ///< HealthReason bits from the input watch, for this sample and those refused before it
};

/// One sample of wheel odometry: the motion of the wheel frame's origin over the ground.
struct WheelSample {
  HostStamp stamp;
  double forward_speed_m_s = 0;
  double yaw_rate_rad_s = 0;
};

enum class HeightKind : std::uint8_t { kBarometer, kRangeFinder };
inline constexpr std::size_t kHeightKinds = 2;

/// One sample of a height sensor. A barometer's is a height above any level that changes slowly, a range finder's the
/// distance to the ground along its beam.
struct HeightSample {
  HostStamp stamp;
  HeightKind kind = HeightKind::kBarometer;
  double metres = 0;
};

/// Cameras beside the first one, at most.
inline constexpr std::size_t kMostOthers = 3;

/// A view of an 8-bit grey image; it does not own the pixels. `stamp` is mid-exposure.
struct Frame {
  HostStamp stamp;
  std::uint64_t sequence = 0;
  const std::uint8_t* data = nullptr;
  int width = 0, height = 0, stride = 0;
  int slot = -1;              ///< the owner's number of the buffer; -1: none
  HostStamp arrival{};        ///< when the driver received it, on the computer's monotonic clock; zero: unknown
  std::uint32_t reasons = 0;  ///< HealthReason bits from the input watch
};

/// What cameras 1 to 3 took at the same time as an image of the first one, or nearly; without data: none.
using OtherFrames = std::array<Frame, kMostOthers>;
/// A time for each of those cameras.
using OtherSpans = std::array<Span, kMostOthers>;

/// One track in one image. It contains everything that the estimator needs to know about the camera.
struct TrackedFeature {
  std::uint32_t id = 0;
  std::uint32_t age = 0;                   ///< images since the track began; 0 in its first image
  std::array<float, 2> pixel{};            ///< raw (distorted) pixel, centre of the top left pixel is (0, 0)
  float row_s = 0;                         ///< its exposure minus the frame's stamp: of its row, or another camera's
  std::array<float, 2> velocity_px_s{};    ///< of `pixel`, from the previous image; zero if age is 0. For display only:
                                           ///< its noise is that of `pixel`, so the estimator must not use it
  std::array<double, 3> bearing{};         ///< unit vector in the camera frame C
  std::array<double, 6> pixel_jacobian{};  ///< d pixel / d bearing, 2x3 row-major, px; its product with `bearing` is 0
};

/// The same track in the image that a second camera took at the same time, or nearly. The second camera of one whose
/// tracks these are is any camera behind it: of the cameras 0 to 3, camera 0 is the first one, which leads.
struct SecondView {
  std::uint32_t id = 0;                    ///< of its TrackedFeature
  std::uint32_t age = 0;                   ///< of that track
  std::uint32_t found = 0;                 ///< age of that track when the second camera found it
  std::array<float, 2> pixel{};            ///< raw, in the second image
  float row_s = 0;                         ///< its exposure minus the frame's stamp
  std::array<double, 3> bearing{};         ///< unit vector in the second camera's frame
  std::array<double, 6> pixel_jacobian{};  ///< d pixel / d bearing, as of TrackedFeature
};

/// Each of the cameras 0 to 3 has so many ids for the tracks that begin in its images; then it begins anew with the
/// first. Where there are no other cameras, ids may be any numbers.
inline constexpr std::uint32_t kTrackIds = 1U << 30;
inline constexpr std::uint32_t first_track_of(std::size_t camera) {
  return static_cast<std::uint32_t>(camera) * kTrackIds;
}
/// The id of the track before which `before` others have begun in the images of the camera whose first id is `first`.
inline constexpr std::uint32_t track_id(std::uint32_t first, std::uint32_t before) {
  return first | (before & (kTrackIds - 1));
}

/// What a camera beside the first one sees.
struct OtherTracks {
  FixedVector<SecondView, kMaxFeatures> views;      ///< of tracks of a camera before it
  FixedVector<TrackedFeature, kMaxFeatures> alone;  ///< its own tracks, with its own ids; bearings in its frame
  void clear() {
    views.clear();
    alone.clear();
  }
  void copy(const OtherTracks& other) {
    views.copy(other.views);
    alone.copy(other.alone);
  }
};

/// All tracks of one image, in any order.
struct TrackedFrame {
  HostStamp stamp;
  std::uint64_t sequence = 0;
  std::uint32_t reasons = 0;  ///< as Frame::reasons
  FixedVector<TrackedFeature, kMaxFeatures> features;
  std::array<OtherTracks, kMostOthers> others;  ///< of cameras 1 to 3; of one that is not there: empty

  /// As an assignment, but of the tracks that are there alone.
  void copy(const TrackedFrame& other) {
    stamp = other.stamp;
    sequence = other.sequence;
    reasons = other.reasons;
    features.copy(other.features);
    for (std::size_t i = 0; i < kMostOthers; ++i) others[i].copy(other.others[i]);
  }
};

enum class HealthState : std::uint8_t { kInitialising, kTracking, kDegraded, kLost };

/// Reasons for the health state; bits of Health::reasons. docs/derivations/health.md.
enum class HealthReason : std::uint32_t {
  kNone = 0,
  kNoInitialState = 1u << 0,  ///< not started yet
  kPosteriorWide = 1u << 1,   ///< started, but the tilt is not certain enough (yet), or the last flight failed
  kFewTracks = 1u << 2,
  kManyGated = 1u << 3,      ///< more than 40 % of the tracks contradict the motion: wrong timestamps or calibration
  kStepsRejected = 1u << 4,  ///< the solver failed in several frames in a row
  kBiasImplausible = 1u << 5,
  kScaleUnknown = 1u << 6,  ///< tilt is certain, but speed and scale are not (yet)
  kDeadlineMissed = 1u << 7,
  kImuGap = 1u << 8,
  kNotFinite = 1u << 9,
  // From the input watch, about the sensors.
  kCameraSilent = 1u << 10,     ///< no image for several usual intervals
  kImuSilent = 1u << 11,        ///< no sample for several usual intervals
  kCameraClockJump = 1u << 12,  ///< timestamps of images jumped against the computer's clock; corrected
  kImuClockJump = 1u << 13,     ///< the same for IMU samples
  kImagesFrozen = 1u << 14,     ///< the same image again; left out
  kLensCovered = 1u << 15,      ///< black, white or without any contrast; left out
  kViewObstructed = 1u << 16,   ///< a large part of the image suddenly lost its contrast
  kExposureStep = 1u << 17,     ///< the brightness changed suddenly
  kImuSaturated = 1u << 18,     ///< samples at the sensor's limit
  kImuStuck = 1u << 19,         ///< the same sample again and again
  kReadingsRefused = 1u << 20,  ///< left out: impossible, repeated or old samples, or several corrupt ones a second
  kImuClockDrift = 1u << 21,    ///< the IMU's clock drifts against the computer's
  kOverloaded = 1u << 22,       ///< too little time: fewer tracks, fewer solver steps, or prediction only
  kNumbersWrong = 1u << 23,     ///< a calibration, unit or time offset contradicts what camera and IMU measure
};
inline constexpr int kHealthReasons = 24;  ///< bits in use

/// Names of states and reasons in files and messages, in the order of the values and bits.
inline constexpr std::array kHealthStateNames = {"initialising", "tracking", "degraded", "lost"};
inline constexpr std::array<const char*, kHealthReasons> kHealthReasonNames = {
    "no_initial_state", "posterior_wide",  "few_tracks",        "many_gated",     "steps_rejected",
    "bias_implausible", "scale_unknown",   "deadline_missed",   "imu_gap",        "not_finite",
    "camera_silent",    "imu_silent",      "camera_clock_jump", "imu_clock_jump", "images_frozen",
    "lens_covered",     "view_obstructed", "exposure_step",     "imu_saturated",  "imu_stuck",
    "readings_refused", "imu_clock_drift", "overloaded",        "numbers_wrong"};

constexpr std::uint32_t bit(HealthReason reason) { return static_cast<std::uint32_t>(reason); }
/// An image with one of these reasons does not show the scene: it has no features, and no evidence of motion or rest.
inline constexpr std::uint32_t kBlindReasons = bit(HealthReason::kImagesFrozen) | bit(HealthReason::kLensCovered);
constexpr bool is_blind(std::uint32_t reasons) { return (reasons & kBlindReasons) != 0; }
/// An IMU sample with one of these reasons does not measure the motion.
inline constexpr std::uint32_t kDistrustReasons = bit(HealthReason::kImuSaturated) | bit(HealthReason::kImuStuck);

struct Health {
  HealthState state = HealthState::kInitialising;
  std::uint32_t reasons = 0;  ///< HealthReason bits
  int quality = 0;            ///< 0 to 100; -1 when lost
};

/// The published estimate. World W: z up. Body B: the IMU.
struct Odometry {
  HostStamp stamp;  ///< timestamp of the image or IMU sample, as a time of the IMU's clock
  std::array<double, 3> p_WB_m{};
  std::array<double, 4> q_WB{1, 0, 0, 0};  ///< Hamilton, w x y z
  std::array<double, 3> v_WB_m_s{};
  std::array<double, 3> omega_B_rad_s{};            ///< bias removed
  std::array<double, 3> accelerometer_bias_m_s2{};  ///< as it is read
  std::array<double, 3> gyroscope_bias_rad_s{};     ///< as it is read
  /// Accelerometer, gyroscope: what readings less their bias have to be multiplied by, less 1.
  std::array<double, 2> imu_scale{};
  double time_offset_s = 0;  ///< t_IMU = t_image + time_offset
  /// 16x16 row-major: dp (W), dtheta (B, right perturbation), dv, dba, dbg, dtd.
  std::array<double, 256> covariance{};
  std::uint32_t reset_counter = 0;
  Health health;
};

}  // namespace epiline
