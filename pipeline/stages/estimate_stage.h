#pragma once
// Tracked features in, odometry out; measures the estimator's phases and passes its deadline on.
#include <cstdint>
#include <limits>

#include "estimator/estimator.h"

namespace epiline {

/// Monotonic time in nanoseconds, from outside: the stages hold no clock.
using NowNs = std::int64_t (*)() noexcept;

class EstimateStage {
 public:
  static constexpr std::int64_t kNoDeadline = std::numeric_limits<std::int64_t>::max();

  EstimateStage(const EstimatorConfig& config, NowNs now) : estimator_(config), watch_(now) {}

  /// How long the parts of one step took.
  struct Times {
    std::int64_t solve_ns = 0, marginalise_ns = 0, estimate_ns = 0;
    std::int64_t late_ns = 0;  ///< ended so long after the deadline; 0: in time, or no deadline
  };

  bool add_imu(const ImuSample& sample) noexcept { return estimator_.add_imu(sample); }
  HostStamp imu_needed_until(HostStamp image) const noexcept { return estimator_.imu_needed_until(image); }

  /// `deadline_ns`: instant of the clock at which the best iterate so far must do.
  StepResult step(const TrackedFrame& frame, std::int64_t deadline_ns) noexcept;

  const Times& times() const noexcept { return watch_.times; }  ///< of the last step
  const Estimator& estimator() const noexcept { return estimator_; }

 private:
  struct Watch final : Supervisor {
    explicit Watch(NowNs clock) : now(clock) {}
    void begin(std::int64_t deadline) noexcept;
    void end() noexcept;
    bool time_is_up() noexcept override { return deadline_ns != kNoDeadline && now() >= deadline_ns; }
    void phase(Phase next) noexcept override;

    NowNs now;
    Times times;
    Phase current = Phase::kNone;
    std::int64_t step_began_ns = 0, phase_began_ns = 0, deadline_ns = kNoDeadline;
  };

  Estimator estimator_;
  Watch watch_;
};

}  // namespace epiline
