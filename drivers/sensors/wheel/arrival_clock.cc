#include "drivers/sensors/wheel/arrival_clock.h"

#include <algorithm>
#include <cstdlib>
#include <ctime>

#include "platform/time/monotonic.h"

namespace epiline {

namespace {

constexpr std::int64_t kOldest_ns = 1'000'000'000;
constexpr std::int64_t kLatest_ns = std::int64_t{1} << 62;  // the year 2116
constexpr std::int64_t kStep_ns = 1'000'000;  // the clock of day is slewed by less than this between two frames

std::int64_t read_clock(clockid_t clock) noexcept {
  timespec t{};
  ::clock_gettime(clock, &t);
  return t.tv_sec * 1'000'000'000LL + t.tv_nsec;
}

bool is_just_past(std::int64_t instant_ns, std::int64_t now_ns) {
  return instant_ns <= now_ns && instant_ns > now_ns - kOldest_ns;
}

}  // namespace

ClockPair ClockPair::now() noexcept {
  ClockPair best;
  std::int64_t least = INT64_MAX;
  for (int i = 0; i < 3; ++i) {  // the pair that was not interrupted
    const std::int64_t before = monotonic_ns(), of_day = read_clock(CLOCK_REALTIME), after = monotonic_ns();
    if (after - before >= least) continue;
    least = after - before;
    best = {of_day, before + (after - before) / 2};
  }
  return best;
}

ArrivalClock::ArrivalClock() noexcept : hardware_(OneWaySettings{}) {}

HostStamp ArrivalClock::arrival(const ArrivalStamps& stamps, const ClockPair& now) noexcept {
  const std::int64_t software_ns = software_arrival(stamps.of_day_ns, now);
  std::int64_t arrival_ns = software_ns;
  const DeviceStamp device{stamps.hardware_ns};
  if (stamps.hardware_ns != 0 && is_clock_time(device)) {
    const ClockOutcome outcome = hardware_.update(device, HostStamp{software_ns});
    const bool translates = outcome != ClockOutcome::kContradicts && outcome != ClockOutcome::kRefused;
    if (translates && hardware_.state().status == ClockStatus::kLocked) arrival_ns = hardware_.translate(device).ns;
  }
  if (!is_just_past(arrival_ns, now.steady_ns)) arrival_ns = software_ns;
  last_ns_ = std::max(last_ns_, arrival_ns);
  return HostStamp{last_ns_};
}

std::int64_t ArrivalClock::software_arrival(std::int64_t of_day_ns, const ClockPair& now) noexcept {
  const std::int64_t offset_before = has_offset_ ? offset_ns_ : now.of_day_ns - now.steady_ns;
  offset_ns_ = now.of_day_ns - now.steady_ns;
  has_offset_ = true;
  if (of_day_ns <= 0 || of_day_ns > kLatest_ns) {
    ++bad_stamps_;
    return now.steady_ns;
  }
  const std::int64_t by_now_ns = of_day_ns - offset_ns_, by_before_ns = of_day_ns - offset_before;
  const bool now_good = is_just_past(by_now_ns, now.steady_ns);
  const bool was_set = std::llabs(offset_ns_ - offset_before) > kStep_ns;
  // set before the frame came, or after: the later arrival is the likelier one, frames do not wait long
  if (was_set && is_just_past(by_before_ns, now.steady_ns) && (!now_good || by_before_ns > by_now_ns))
    return by_before_ns;
  if (now_good) return by_now_ns;
  ++bad_stamps_;
  return now.steady_ns;
}

}  // namespace epiline
