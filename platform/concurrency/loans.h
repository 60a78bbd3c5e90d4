#pragma once
// How many threads use each buffer that its owner has lent, so that pixels travel as a number and the last user gives
// the buffer back. The buffers are elsewhere: this counts their users.
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

  /// The slot's first user, before it hands the slot on: the thread that has just got it from the owner.
  void lend(std::size_t slot) noexcept {
    users_[slot].store(1, std::memory_order_relaxed);  // nobody else knows the slot; the hand-over orders this store
  }

  /// One more user. Only by a thread that uses the slot, before it hands the slot on.
  void share(std::size_t slot) noexcept {
    // relaxed: the count cannot fall to zero meanwhile, and the hand-over itself orders the buffer
    users_[slot].fetch_add(1, std::memory_order_relaxed);
  }

  /// One user less: the caller must not touch the buffer afterwards. True: it was the last one, and everything that the
  /// others did with the buffer lies before. Then the caller returns the buffer to its owner.
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
