#include "drivers/program/hil/played_sensors.h"

#include <sched.h>

#include <algorithm>
#include <utility>

#include "platform/time/sleep.h"

namespace epiline::hil {

namespace {

constexpr std::int64_t kBurst_ns = 80'000'000, kNsPerSecond = 1'000'000'000;

/// Waits for the start; false: it has not come by the deadline.
bool wait_for_start(const PlayClock& clock, std::int64_t deadline_ns) {
  constexpr std::int64_t kLook_ns = 2'000'000;
  while (!clock.started()) {
    const std::int64_t now_ns = monotonic_ns();
    if (now_ns >= deadline_ns) return false;
    sleep_until(std::min(now_ns + kLook_ns, deadline_ns));
  }
  return true;
}

/// Gives this thread the lowest real-time priority, if permitted, and so the threads that it starts during this
/// object's lifetime: above all ordinary threads and below everything under test.
class HardwarePriority {
 public:
  HardwarePriority() noexcept {
    const sched_param lowest{1};
    policy_ = ::sched_getscheduler(0);
    ::sched_getparam(0, &before_);
    changed_ = policy_ == SCHED_OTHER && ::sched_setscheduler(0, SCHED_FIFO, &lowest) == 0;
  }
  ~HardwarePriority() {
    if (changed_) ::sched_setscheduler(0, policy_, &before_);
  }
  HardwarePriority(const HardwarePriority&) = delete;
  HardwarePriority& operator=(const HardwarePriority&) = delete;

 private:
  int policy_ = SCHED_OTHER;
  sched_param before_{};
  bool changed_ = false;
};

}  // namespace

std::int64_t Delivery::instant_ns(std::int64_t due_ns, std::int64_t begin_ns) {
  std::int64_t instant_ns = due_ns;
  if (disturbance_.jitter_ms > 0)
    instant_ns += static_cast<std::int64_t>(1e6 * random_.uniform(0, disturbance_.jitter_ms));
  if (disturbance_.bursts) {
    const std::int64_t phase_ns = (instant_ns - begin_ns) % kNsPerSecond;
    if (phase_ns >= 0 && phase_ns < kBurst_ns) instant_ns += kBurst_ns - phase_ns;
  }
  newest_ns_ = std::max(newest_ns_, instant_ns);
  return newest_ns_;
}

Status PlayedCamera::open() {
  if (std::exchange(open_, true)) return Done{};
  const HardwarePriority priority;  // of the thread that decodes: it stands for hardware
  return recorded_.open();
}

ReadOutcome PlayedCamera::read(Frame& frame, Span timeout) noexcept {
  const std::int64_t deadline_ns = monotonic_ns() + timeout.ns;
  if (!wait_for_start(clock_, deadline_ns)) return ReadOutcome::kTimeout;
  const Pace& pace = clock_.pace();
  if (!started_) recorded_.start(pace);
  started_ = true;
  while (!held_) {
    Frame next;
    const ReadOutcome outcome = recorded_.read(next, Span{std::max<std::int64_t>(deadline_ns - monotonic_ns(), 0)});
    if (outcome != ReadOutcome::kSample) return outcome;
    if (delivery_.loses()) {
      recorded_.give_back(next);
      continue;
    }
    next.stamp.ns = pace.host_of(next.stamp);
    held_ = next;
    held_until_ns_ = delivery_.instant_ns(next.stamp.ns, pace.host_ns);
  }
  sleep_until(std::min(held_until_ns_, deadline_ns));
  if (held_until_ns_ > deadline_ns) return ReadOutcome::kTimeout;
  frame = *held_;
  frame.arrival.ns = monotonic_ns();
  held_.reset();
  return ReadOutcome::kSample;
}

OtherFrames PlayedCamera::others(const Frame& frame) const noexcept {
  OtherFrames others = recorded_.others(frame);
  for (Frame& other : others) other.stamp.ns = clock_.pace().host_of(other.stamp);
  return others;
}

/// Takes the next reading out of the recording; false: there is none.
bool PlayedImu::prepare() noexcept {
  while (!held_ && next_ < samples_.size()) {
    if (last_ && samples_[next_].stamp > *last_) return false;
    ImuSample sample = samples_[next_++];
    if (delivery_.loses()) continue;
    const Pace& pace = clock_.pace();
    const std::int64_t due_ns = pace.host_of(sample.stamp);
    sample.stamp.ns = due_ns + static_cast<std::int64_t>(skew_ * static_cast<double>(due_ns - pace.host_ns));
    held_ = sample;
    held_until_ns_ = delivery_.instant_ns(due_ns, pace.host_ns);
  }
  return held_.has_value();
}

ReadOutcome PlayedImu::read(std::span<ImuSample> samples, std::size_t& count, Span timeout) noexcept {
  count = 0;
  const std::int64_t deadline_ns = monotonic_ns() + timeout.ns;
  if (!wait_for_start(clock_, deadline_ns)) return ReadOutcome::kTimeout;
  if (!prepare()) return ReadOutcome::kEnd;
  sleep_until(std::min(held_until_ns_, deadline_ns));
  const std::int64_t now_ns = monotonic_ns();
  while (count < samples.size() && prepare() && held_until_ns_ <= now_ns) {
    samples[count] = *held_;
    samples[count++].arrival.ns = now_ns;
    held_.reset();
  }
  return count > 0 ? ReadOutcome::kSample : ReadOutcome::kTimeout;
}

}  // namespace epiline::hil
