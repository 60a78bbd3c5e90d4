#pragma once
// Number of lock calls of the current thread into the C library. The counter is always linked; it counts in programs
// that also link the CMake target `epiline_lock_count` (platform/linux/lock_interposer.cc).
#include <cstdint>

namespace epiline {

namespace detail {
/// Written by the interposer only.
[[gnu::tls_model("initial-exec")]] extern constinit thread_local std::uint64_t lock_calls;
}  // namespace detail

/// Calls by this thread since it began that lock a mutex (pthread_mutex_lock, _trylock, _timedlock; std::mutex is one
/// of them) or wait for a condition. Always 0 where lock_counting_available() is false.
inline std::uint64_t lock_calls_of_this_thread() noexcept {
  return *static_cast<const volatile std::uint64_t*>(&detail::lock_calls);
}

/// True if locks really are counted in this program; found out by locking one.
bool lock_counting_available() noexcept;

}  // namespace epiline
