#pragma once
// Counts the users of lent buffers. Threads pass the number of a buffer instead of its pixels, and the last user
// returns it to the owner. This class does not hold the buffers.
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "platform/concurrency/spsc_ring.h"

namespace epiline {

/// Slots 0 to `N` - 1. All calls are wait-free.
template <std::size_t N, class Orders = SoundOrders>
class Loans {
 public:
  Loans() = default;
  Loans(const Loans&) = delete;
  Loans& operator=(const Loans&) = delete;

  /// Registers the slot's first user: the thread that received it from the owner, before it passes the slot on.
  void lend(std::size_t slot) noexcept {
    users_[slot].store(1, std::memory_order_relaxed);  // nobody else knows the slot; the hand-over orders this store
  }

  /// Adds a user. Only by a thread that uses the slot, before it passes the slot on.
  void share(std::size_t slot) noexcept {
    // relaxed: the count cannot fall to zero meanwhile, and the hand-over itself orders the buffer
    users_[slot].fetch_add(1, std::memory_order_relaxed);
  }

  /// Removes a user, which must not touch the buffer afterwards. True: it was the last user, and all accesses of the
  /// others happen before this call returns; the caller then returns the buffer to its owner.
  [[nodiscard]] bool give_back(std::size_t slot) noexcept {
    // release: hands this user's last look on to the last user; acquire: the last user has those of all others
    return users_[slot].fetch_sub(1, Orders::kSwap) == 1;
  }

  /// Any thread: a recent value.
  std::uint32_t users(std::size_t slot) const noexcept { return users_[slot].load(std::memory_order_relaxed); }

 private:
  std::array<std::atomic<std::uint32_t>, N> users_{};
};

}  // namespace epiline
