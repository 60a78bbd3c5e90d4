#pragma once
// Who uses which buffer. The buffers are elsewhere (memory of a camera driver, decoded images); this only counts their
// users, so that pixels travel as a number and the last reader gives the buffer back.
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "platform/concurrency/spsc_ring.h"

namespace epiline {

/// `N` slots, of which the first `size` are in use. One thread, the owner, takes free slots; any thread that holds one
/// may share it or give it back. All calls are wait-free; take() looks at each slot at most once.
template <std::size_t N, class Orders = SoundOrders>
class SlotPool {
 public:
  static constexpr int kNone = -1;

  explicit SlotPool(std::size_t size = N) noexcept : size_(size < N ? size : N) {}
  SlotPool(const SlotPool&) = delete;
  SlotPool& operator=(const SlotPool&) = delete;

  std::size_t size() const noexcept { return size_; }

  /// Owner thread only. A slot nobody uses, now with one user: the owner may write its buffer. kNone, and one more in
  /// exhausted(), if and only if all are in use. The longest unused come first.
  int take() noexcept {
    std::size_t used = 0, found = N;
    for (std::size_t k = 0; k < size_; ++k) {
      const std::size_t i = (next_ + k) % size_;
      // acquire, pairs with the release in give_back(): the last look of every reader comes before we write
      if (users_[i].load(Orders::kReclaim) != 0) {
        ++used;
      } else if (found == N) {
        found = i;
      }
    }
    if (found == N) {
      bump(exhausted_);
      return kNone;
    }
    users_[found].store(1, std::memory_order_relaxed);  // nobody else looks at a free slot
    next_ = (found + 1) % size_;
    if (used + 1 > high_water_.load(std::memory_order_relaxed)) high_water_.store(used + 1, std::memory_order_relaxed);
    return static_cast<int>(found);
  }

  /// One more user. Only by a thread that holds the slot, before it hands the slot on.
  void share(int slot) noexcept {
    // relaxed: the count cannot fall to zero meanwhile, and the hand-over itself orders the buffer
    users_[static_cast<std::size_t>(slot)].fetch_add(1, std::memory_order_relaxed);
  }

  /// One user less; the buffer must not be touched afterwards.
  void give_back(int slot) noexcept {
    // release, pairs with the acquire in take(). Several readers: each subtraction continues the release sequence of
    // those before it, so the owner sees the last look of all
    users_[static_cast<std::size_t>(slot)].fetch_sub(1, Orders::kRelease);
  }

  // Any thread: a recent value.

  std::uint32_t users(int slot) const noexcept {
    return users_[static_cast<std::size_t>(slot)].load(std::memory_order_relaxed);
  }
  /// The most slots that were in use at once, as the owner found it.
  std::size_t high_water() const noexcept { return high_water_.load(std::memory_order_relaxed); }
  /// How often take() found none.
  std::uint64_t exhausted() const noexcept { return exhausted_.load(std::memory_order_relaxed); }

 private:
  static void bump(std::atomic<std::uint64_t>& counter) noexcept {
    counter.store(counter.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
  }

  std::size_t size_, next_ = 0;
  std::atomic<std::size_t> high_water_{0};
  std::atomic<std::uint64_t> exhausted_{0};
  std::array<std::atomic<std::uint32_t>, N> users_{};
};

}  // namespace epiline
