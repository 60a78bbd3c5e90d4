#pragma once
// The state at the newest IMU reading, for receivers that cannot wait for images. Derivation:
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
  double blend_s = 0.1;           ///< a correction's difference falls to 1/e in this time; 0: every correction jumps
  double blend_most_m = 0.5;      ///< a correction that moves position by more jumps
  double blend_most_rad = 0.1;    ///< attitude
  double blend_most_m_s = 1.0;    ///< velocity
  double coasting_after_s = 0.5;  ///< age of the solved state from which the prediction is called coasting
  double stale_after_s = 2.0;     ///< and from which it is called lost
};

/// The defaults with the noise that this estimator assumes.
PredictorConfig predictor_config(const EstimatorConfig& estimator) noexcept;

struct PredictorStats {
  std::uint64_t imu_samples = 0, imu_out_of_order = 0, imu_duplicate = 0, imu_not_finite = 0;
  std::uint64_t imu_impossible = 0, imu_far_ahead = 0;     ///< as in EstimatorStats
  std::uint64_t corrections = 0, jumps = 0;                ///< taken; and those of them that were not blended
  std::uint64_t deferred = 0;                              ///< came before the readings of their time
  std::uint64_t not_finite = 0, old = 0, no_readings = 0;  ///< left out
};

/// Carries the last solved state on over every IMU reading. One thread at a time; no clock, lock or heap. It holds its
/// readings inside (240 kB): not for small stacks.
class Predictor {
 public:
  enum class State : std::uint8_t {
    kWaiting,   ///< no solved state yet: no pose
    kCurrent,   ///< the last solve is at most coasting_after_s old
    kCoasting,  ///< older: readings alone, uncertainty grows
    kStale,     ///< older than stale_after_s: do not use
  };
  enum class Correction : std::uint8_t {
    kBlended,     ///< taken; the output goes over to it smoothly
    kJumped,      ///< taken at once: the first one, another reset counter, too large a difference, or blending is off
    kDeferred,    ///< kept until the readings reach its time; a later correction replaces it
    kNotFinite,   ///< left out: a number is not finite, or the quaternion not of unit length
    kOld,         ///< left out: not newer than the last one
    kNoReadings,  ///< left out: the readings held begin after its time
  };

  explicit Predictor(const PredictorConfig& config) noexcept : config_(config) {}

  /// One reading, in time order; old, doubled and not finite ones are counted and left out. Work: one integration step,
  /// and that of a deferred correction.
  ImuHistory::Push add_imu(const ImuSample& sample) noexcept;

  /// A state the estimator has solved (StepResult::solved; never one it predicted, whose covariance is that of an older
  /// frame, nor one of this class). Work: one step per reading since its image, the 4096 that are held at most.
  Correction correct(const Odometry& solved) noexcept;

  /// Forgets the state, as before the first correction. Readings and counts stay.
  void clear() noexcept;

  State state() const noexcept;
  /// From the last solved state to the newest reading, in the IMU's time; 0 while waiting.
  double age_s() const noexcept;

  /// The state at the newest reading; `stamp` is that reading's, and all of it, covariance too, belongs to this
  /// instant. Order and frames as in Odometry; biases, time offset and reset counter are the last solve's. Health is
  /// the last solve's, except: coasting, tracking becomes degraded with the reason deadline_missed; stale, it is lost.
  /// A default Odometry (initialising) while waiting.
  Odometry odometry() const noexcept;

  const PredictorStats& stats() const noexcept { return stats_; }

 private:
  struct Offset {                                                 // published minus predicted
    Vec3 p = Vec3::Zero(), phi = Vec3::Zero(), v = Vec3::Zero();  // phi in W: R_published = Exp(phi) R
  };

  void extend(HostStamp before) noexcept;
  Correction apply(const Odometry& solved, HostStamp time) noexcept;
  void set_base(const Odometry& solved, HostStamp time) noexcept;
  NavState predicted() const noexcept;
  Offset offset() const noexcept;
  bool blendable(const Offset& offset) const noexcept;

  PredictorConfig config_;
  ImuHistory history_;
  PredictorStats stats_;

  bool started_ = false, waiting_ = false;
  Odometry waiting_for_readings_;
  Odometry solved_;      // the last correction
  HostStamp base_time_;  // of the IMU
  NavState base_;        // at base_time_
  BodyCovariance base_covariance_;
  Preintegration interval_;  // from base_time_ to the newest reading
  Offset offset_;            // as it was at offset_time_
  HostStamp offset_time_;
};

}  // namespace epiline
