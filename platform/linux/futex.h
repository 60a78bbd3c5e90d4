#pragma once
// Sleeping on a word of memory, and waking whoever sleeps there.
#include <atomic>
#include <cstdint>

namespace epiline {

/// Sleeps while `word` is `expected`, until a wake-up or until `deadline_ns` of monotonic_ns(). False if and only if
/// the deadline has passed; it may return true for no reason.
bool futex_wait_until(const std::atomic<std::uint32_t>& word, std::uint32_t expected,
                      std::int64_t deadline_ns) noexcept;

/// Wakes all threads of this process that sleep on `word`. Does not wait.
void futex_wake(const std::atomic<std::uint32_t>& word) noexcept;

}  // namespace epiline
