#pragma once
#include <ctime>

#include <cstdint>

namespace epiline {

/// Until this instant of monotonic_ns(), or a signal.
inline void sleep_until(std::int64_t host_ns) noexcept {
  constexpr std::int64_t kSecond = 1'000'000'000;
  const timespec until{static_cast<time_t>(host_ns / kSecond), static_cast<long>(host_ns % kSecond)};
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr);
}

}  // namespace epiline
