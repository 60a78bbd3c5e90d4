#pragma once
#include <ctime>

#include <cstdint>

namespace epiline {

/// Of a time, or an instant of monotonic_ns(), that is not negative.
inline timespec timespec_of(std::int64_t ns) noexcept {
  constexpr std::int64_t kSecond = 1'000'000'000;
  return {static_cast<time_t>(ns / kSecond), static_cast<long>(ns % kSecond)};
}

/// Until this instant of monotonic_ns(), or a signal.
inline void sleep_until(std::int64_t host_ns) noexcept {
  const timespec until = timespec_of(host_ns);
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr);
}

}  // namespace epiline
