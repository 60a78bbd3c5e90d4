#pragma once
// Sleep on a word of memory, and wake the threads that sleep on it.
#include <atomic>
#include <cstdint>

namespace epiline {

/// Sleeps while `word` equals `expected`, until woken or until `deadline_ns` of monotonic_ns(). False if and only if
/// the deadline has passed; true may be a spurious wake-up.
bool futex_wait_until(const std::atomic<std::uint32_t>& word, std::uint32_t expected,
                      std::int64_t deadline_ns) noexcept;

/// Wakes all threads of this process that sleep on `word`. Does not wait.
void futex_wake(const std::atomic<std::uint32_t>& word) noexcept;

}  // namespace epiline
