#include "pipeline/stages/back_end.h"

#include <algorithm>

namespace epiline {

void BackEnd::Watch::begin(HostStamp frame, std::int64_t deadline) noexcept {
  times = {};
  times.load = governor.level();
  current = Phase::kNone;
  stamp = frame;
  planned = false;
  steps = 0;
  deadline_ns = deadline;
  work_began = phase_began = clocks.now();
}

void BackEnd::Watch::begin_slide() noexcept { work_began = phase_began = clocks.now(); }

void BackEnd::Watch::end_step() noexcept {
  end();
  times.late_ns = std::max<std::int64_t>(0, phase_began.wall_ns - deadline_ns);  // no clock goes past kNoDeadline
}

void BackEnd::Watch::end() noexcept {
  phase(Phase::kNone);
  times.estimate += phase_began - work_began;
}

/// The solve gets what is left until the deadline when all the rest is done, and no more than it may take anyway.
Supervisor::Effort BackEnd::Watch::effort() noexcept {
  planned = true;
  planned_ns = clocks.wall();
  budget_ns = most_solve_ns > 0 ? most_solve_ns : kNoDeadline;
  const std::int64_t left_ns =
      deadline_ns == kNoDeadline ? kNoDeadline : deadline_ns - planned_ns - static_cast<std::int64_t>(besides_ns.get());
  const LoadGovernor::Plan plan = governor.plan(stamp, std::min(budget_ns, left_ns), budget_ns < left_ns);
  budget_ns = std::min(budget_ns, left_ns);
  times.load = plan.level;
  return plan.effort;
}

/// Asked after each step of the solve: is there no time for one like those before?
bool BackEnd::Watch::time_is_up() noexcept {
  ++steps;
  if (!planned || budget_ns == kNoDeadline) return false;
  const std::int64_t spent_ns = clocks.wall() - phase_began.wall_ns;
  return spent_ns + spent_ns / (steps + 1) > budget_ns;  // the first step linearises twice, the others once
}

void BackEnd::Watch::phase(Phase next) noexcept {
  const StageTime now = clocks.now();
  if (current == Phase::kSolve) times.solve += now - phase_began;
  if (current == Phase::kMarginalise) times.marginalise += now - phase_began;
  current = next;
  phase_began = now;
}

void BackEnd::Watch::learn(const EstimatorStats& before, const EstimatorStats& after) noexcept {
  if (!planned || after.solves == before.solves) return;
  governor.took(times.solve.wall_ns, static_cast<int>(after.tracks_offered - before.tracks_offered),
                static_cast<int>(after.tracks_used - before.tracks_used),
                static_cast<int>(after.linearisations - before.linearisations));
  besides_ns.add(static_cast<double>(work_began.wall_ns + times.estimate.wall_ns - planned_ns - times.solve.wall_ns));
}

bool BackEnd::add_imu(const ImuSample& sample) noexcept {
  imu_reasons_ |= sample.reasons;
  return estimator_.add_imu(sample);
}

StepResult BackEnd::step(const TrackedFrame& frame, std::int64_t deadline_ns) noexcept {
  const EstimatorStats before = estimator_.stats();
  watch_.begin(frame.stamp, deadline_ns);
  const StepResult result = estimator_.process(frame, watch_);
  watch_.end_step();
  watch_.learn(before, estimator_.stats());
  // silence of the camera is seen here by the stamps alone: no more than one thread would know
  const std::uint32_t silent = silent_sensors(heard_, frame.stamp);
  heard_.heard_image(frame.stamp);
  odometry_ = estimator_.odometry();
  odometry_.health = merge_.step(odometry_.health, frame.reasons | imu_reasons_ | silent, frame.stamp);
  imu_reasons_ = 0;
  return result;
}

bool BackEnd::slide() noexcept {
  watch_.begin_slide();
  const bool keyframe = estimator_.slide(watch_);
  watch_.end();
  return keyframe;
}

}  // namespace epiline
