#pragma once
// How often the current thread has gone to a lock of the C library. As with heap calls: the counter is always linked,
// and it moves in programs that link the CMake target `epiline_lock_count` (platform/linux/lock_interposer.cc).
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
