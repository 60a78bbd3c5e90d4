#include "pipeline/stages/estimate_stage.h"

#include <algorithm>

namespace epiline {

void EstimateStage::Watch::begin(std::int64_t deadline) noexcept {
  times = {};
  current = Phase::kNone;
  deadline_ns = deadline;
  step_began_ns = phase_began_ns = now();
}

void EstimateStage::Watch::end() noexcept {
  phase(Phase::kNone);
  times.estimate_ns = phase_began_ns - step_began_ns;
  if (deadline_ns != kNoDeadline) times.late_ns = std::max<std::int64_t>(0, phase_began_ns - deadline_ns);
}

void EstimateStage::Watch::phase(Phase next) noexcept {
  const std::int64_t t = now();
  if (current == Phase::kSolve) times.solve_ns += t - phase_began_ns;
  if (current == Phase::kMarginalise) times.marginalise_ns += t - phase_began_ns;
  current = next;
  phase_began_ns = t;
}

StepResult EstimateStage::step(const TrackedFrame& frame, std::int64_t deadline_ns) noexcept {
  watch_.begin(deadline_ns);
  const StepResult result = estimator_.process(frame, watch_);
  watch_.end();
  return result;
}

}  // namespace epiline
