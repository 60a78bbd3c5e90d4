#pragma once
// A counter that one thread writes and any may read: no locked instruction is needed.
#include <atomic>
#include <cstdint>

namespace epiline {

/// By the one thread that writes the counter.
inline void bump(std::atomic<std::uint64_t>& counter, std::uint64_t by = 1) noexcept {
  counter.store(counter.load(std::memory_order_relaxed) + by, std::memory_order_relaxed);
}

}  // namespace epiline
