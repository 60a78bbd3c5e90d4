#pragma once
// Predicts the state to the newest IMU sample, for receivers that need odometry between images. Derivation:
// docs/derivations/prediction.md.
#include <cstdint>

#include "estimator/config.h"
#include "estimator/geometry/types.h"
#include "estimator/inertial/imu_history.h"
#include "estimator/inertial/nav_state.h"
#include "estimator/inertial/preintegration.h"
#include "estimator/predict/covariance.h"
#include "platform/samples/samples.h"

namespace epiline {

struct PredictorConfig {
  ImuHistory::Density density;    ///< the estimator's, its factors included: see predictor_config()
  double blend_s = 0.1;           ///< time constant with which a correction is blended in; 0: every correction jumps
  double blend_most_m = 0.5;      ///< a correction of the position beyond this jumps
  double blend_most_rad = 0.1;    ///< the same for the attitude
  double blend_most_m_s = 1.0;    ///< the same for the velocity
  double coasting_after_s = 0.5;  ///< the prediction is coasting if the solved state is older
  double stale_after_s = 2.0;     ///< and lost if it is older than this
};

/// The defaults with the noise that this estimator assumes.
PredictorConfig predictor_config(const EstimatorConfig& estimator) noexcept;

struct PredictorStats {
  std::uint64_t imu_samples = 0, imu_out_of_order = 0, imu_duplicate = 0, imu_not_finite = 0;
  std::uint64_t imu_impossible = 0, imu_far_ahead = 0;  ///< as in EstimatorStats
  std::uint64_t corrections = 0, jumps = 0;             ///< corrections used, and those of them that were not blended
  std::uint64_t deferred = 0;  ///< corrections held, because the IMU samples of their time had not arrived
  std::uint64_t not_finite = 0, old = 0, no_readings = 0;  ///< left out
};

/// Propagates the last solved state over every IMU sample. One thread at a time; no clock, lock or heap. It contains
/// its samples (240 kB), so do not put it on a small stack.
class Predictor {
 public:
  enum class State : std::uint8_t {
    kWaiting,   ///< no solved state yet: no pose
    kCurrent,   ///< the last solve is at most coasting_after_s old
    kCoasting,  ///< older: prediction by the IMU alone, with growing uncertainty
    kStale,     ///< older than stale_after_s: do not use
  };
  enum class Correction : std::uint8_t {
    kBlended,     ///< used; the output moves to it smoothly
    kJumped,      ///< used at once: first correction, new reset counter, too large a difference, or blending is off
    kDeferred,    ///< held until the IMU samples reach its time; a later correction replaces it
    kNotFinite,   ///< left out: a number is not finite, or the quaternion not of unit length
    kOld,         ///< left out: not newer than the last one
    kNoReadings,  ///< left out: the readings held begin after its time
  };

  explicit Predictor(const PredictorConfig& config) noexcept : config_(config) {}

  /// Adds an IMU sample, in time order; old, repeated and non-finite ones are counted and left out. Cost: one
  /// integration step, and that of a deferred correction.
  ImuHistory::Push add_imu(const ImuSample& sample) noexcept;

  /// Corrects with a solved state (StepResult::solved). Do not pass predicted states: their covariance is that of an
  /// older frame. Cost: one step per IMU sample since its image, at most 4096.
  Correction correct(const Odometry& solved) noexcept;

  /// Discards the state, as before the first correction. Samples and counters stay.
  void clear() noexcept;

  State state() const noexcept;
  /// Time from the last solved state to the newest IMU sample; 0 while waiting.
  double age_s() const noexcept;

  /// The state at the newest IMU sample; `stamp` and covariance belong to that time. Order and frames as in Odometry.
  /// Biases and time offset are those of the last solve; its reset counter is increased by one for each correction that
  /// was too large to be blended in, since a receiver must not take that for motion. Health is that of the last solve,
  /// except that tracking becomes degraded with the reason deadline_missed while coasting, and lost when stale. A
  /// default Odometry (initialising) while waiting.
  Odometry odometry() const noexcept;

  const PredictorStats& stats() const noexcept { return stats_; }

 private:
  struct Offset {                                                 // published minus predicted
    Vec3 p = Vec3::Zero(), phi = Vec3::Zero(), v = Vec3::Zero();  // phi in W: R_published = Exp(phi) R
  };

  void extend(HostStamp before) noexcept;
  Correction apply(const Odometry& solved, HostStamp time) noexcept;
  void set_base(const Odometry& solved, HostStamp time) noexcept;
  ImuScale scale() const noexcept;
  NavState predicted() const noexcept;
  Offset offset() const noexcept;
  bool is_small(const Offset& offset) const noexcept;

  PredictorConfig config_;
  ImuHistory history_;
  PredictorStats stats_;

  bool started_ = false, waiting_ = false;
  Odometry waiting_for_readings_;
  Odometry solved_;                      // the last correction
  HostStamp base_time_;                  // of the IMU
  std::uint32_t large_corrections_ = 0;  // that the solves' own reset counter does not tell of
  NavState base_;                        // at base_time_
  BodyCovariance base_covariance_;
  Preintegration interval_;  // from base_time_ to the newest reading
  Offset offset_;            // as it was at offset_time_
  HostStamp offset_time_;
};

}  // namespace epiline
