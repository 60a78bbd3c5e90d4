#pragma once
// Tracked features in, odometry out: the estimator, with one health of everything. Measures the estimator's phases and
// keeps it to its deadline.
#include <cstdint>
#include <limits>

#include "estimator/estimator.h"
#include "pipeline/stages/load_governor.h"
#include "pipeline/stages/stage_clocks.h"
#include "pipeline/watch/health_merge.h"

namespace epiline {

class BackEnd {
 public:
  static constexpr std::int64_t kNoDeadline = std::numeric_limits<std::int64_t>::max();

  /// `solve_ns`: longest time of a solve; 0: no limit.
  BackEnd(const EstimatorConfig& config, const StageClocks& clocks, std::int64_t solve_ns)
      : estimator_(config), watch_(clocks, solve_ns), odometry_(estimator_.odometry()) {}

  /// Durations of the parts of one step, and of the slide that follows it.
  struct Times {
    StageTime solve, marginalise, estimate;
    std::int64_t late_ns = 0;  ///< when the odometry was ready, minus the deadline; 0: in time, or no deadline
    LoadLevel load = LoadLevel::kFull;
  };

  bool add_imu(const ImuSample& sample) noexcept;
  bool add_wheel(const WheelSample& sample) noexcept { return estimator_.add_wheel(sample); }
  bool add_height(const HeightSample& sample) noexcept { return estimator_.add_height(sample); }
  HostStamp imu_needed_until(HostStamp image) const noexcept { return estimator_.imu_needed_until(image); }

  /// `deadline_ns`: time of the clock at which the odometry should be ready.
  StepResult step(const TrackedFrame& frame, std::int64_t deadline_ns) noexcept;
  /// What the odometry of that image need not wait for: Estimator::slide().
  bool slide() noexcept;

  /// The estimator's odometry, with its health merged with the watch's verdict on the samples.
  const Odometry& odometry() const noexcept { return odometry_; }
  const Times& times() const noexcept { return watch_.times; }  ///< of the last step
  const Estimator& estimator() const noexcept { return estimator_; }
  const LoadGovernor::Counts& load() const noexcept { return watch_.governor.counts(); }

 private:
  struct Watch final : Supervisor {
    Watch(const StageClocks& both, std::int64_t solve) : clocks(both), most_solve_ns(solve) {}
    void begin(HostStamp frame, std::int64_t deadline) noexcept;
    void end_step() noexcept;
    void begin_slide() noexcept;
    void end() noexcept;
    Effort effort() noexcept override;
    bool time_is_up() noexcept override;
    void phase(Phase next) noexcept override;
    void learn(const EstimatorStats& before, const EstimatorStats& after) noexcept;

    StageClocks clocks;
    std::int64_t most_solve_ns;
    LoadGovernor governor;
    RecentMost besides_ns;  ///< what a step takes besides its solve
    Times times;
    Phase current = Phase::kNone;
    HostStamp stamp;
    bool planned = false;
    int steps = 0;  ///< of this solve, so far
    StageTime work_began, phase_began;
    std::int64_t planned_ns = 0, deadline_ns = kNoDeadline, budget_ns = kNoDeadline;
  };

  Estimator estimator_;
  Watch watch_;
  HealthMerge merge_;
  LastHeard heard_;
  std::uint32_t imu_reasons_ = 0;  ///< since the last step
  Odometry odometry_;
};

}  // namespace epiline
