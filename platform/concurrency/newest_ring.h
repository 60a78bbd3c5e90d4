#pragma once
// A ring of small numbers, such as buffer numbers, between one producer and one consumer. The newest number always
// finds room: a full ring returns the oldest one to the producer.
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "platform/concurrency/counter.h"
#include "platform/concurrency/spsc_ring.h"

namespace epiline {

/// `N` values. In order and complete while it does not overflow. When it has overflowed, the next pop takes everything
/// out at once, returns the newest value and hands the others, which are overtaken, to its visitor. So nothing stays
/// behind: a consumer that has popped until kNone has taken out every value pushed before.
///
/// The whole ring is one word: a lane for each value, the oldest in the lowest one, and a bit that marks an
/// overflow. Both sides replace the whole word, so each value leaves the ring exactly once and into one hand: popped,
/// evicted (returned by push) or overtaken. What a value names was written before push and belongs to the thread that
/// took the value out.
///
/// Both sides are wait-free. A push fails to replace the word only when a pop came between, and those end when the ring
/// is empty: at most N failures. A pop fails only when a push came between, and N of those overflow the ring, which is
/// then taken by an exchange that cannot fail: at most N failures. A word never comes back between a side's look and
/// its replacement: pops only shorten it, pushes only lengthen it or set the bit, which only a pop clears.
template <std::size_t N, class Orders = SoundOrders>
class NewestRing {
  static constexpr int kLaneBits = 15;
  static_assert(N >= 1 && N * kLaneBits < 64, "lanes and the bit of overflow are one word");

 public:
  using Value = std::uint16_t;
  static constexpr Value kNone = 0xffff;
  static constexpr Value kLargest = (1U << kLaneBits) - 2;

  NewestRing() = default;
  NewestRing(const NewestRing&) = delete;
  NewestRing& operator=(const NewestRing&) = delete;

  static constexpr std::size_t capacity() { return N; }

  /// Producer thread only. Returns the value that had to leave for it, or kNone. `value` is at most kLargest.
  Value push(Value value) noexcept {
    std::uint64_t before = word_.load(std::memory_order_relaxed), after = 0;
    do {
      after = with(before, value);
      // release, pairs with the acquire of pop(): what the value names is complete before the consumer can have it
    } while (!word_.compare_exchange_strong(before, after, Orders::kPublish, std::memory_order_relaxed));
    bump(pushed_);
    if (fill(after) > high_water_.load(std::memory_order_relaxed))
      high_water_.store(fill(after), std::memory_order_relaxed);
    if (fill(before) < N) return kNone;
    bump(evicted_);
    return oldest(before);
  }

  /// Consumer thread only: false means that pop() would find nothing.
  bool ready() const noexcept { return word_.load(std::memory_order_relaxed) != 0; }  // a hint

  /// Consumer thread only. The next value, or kNone if the ring is empty. After an overflow, calls `overtaken(value)`
  /// for each value older than the returned one, oldest first.
  template <class Visitor>
  Value pop(Visitor overtaken) noexcept {
    std::uint64_t before = word_.load(std::memory_order_relaxed);
    while ((before & kOverflow) == 0) {
      if (before == 0) return kNone;
      // acquire, pairs with the release of push()
      if (word_.compare_exchange_strong(before, before >> kLaneBits, Orders::kObserve, std::memory_order_relaxed)) {
        bump(popped_);
        return oldest(before);
      }
    }
    std::uint64_t rest = word_.exchange(0, Orders::kObserve) & ~kOverflow;  // acquire as above
    for (; fill(rest) > 1; rest >>= kLaneBits) {
      bump(overtaken_);
      overtaken(oldest(rest));
    }
    bump(popped_);
    return oldest(rest);
  }

  // Any thread. Exact on the thread named, a recent value elsewhere.

  std::uint64_t pushed() const noexcept { return pushed_.load(std::memory_order_relaxed); }        ///< exact: producer
  std::uint64_t evicted() const noexcept { return evicted_.load(std::memory_order_relaxed); }      ///< exact: producer
  std::uint64_t popped() const noexcept { return popped_.load(std::memory_order_relaxed); }        ///< exact: consumer
  std::uint64_t overtaken() const noexcept { return overtaken_.load(std::memory_order_relaxed); }  ///< exact: consumer
  /// The most values that waited at once; exact: producer.
  std::size_t high_water() const noexcept { return high_water_.load(std::memory_order_relaxed); }

 private:
  static constexpr std::uint64_t kOverflow = 1ULL << 63;  ///< a value was evicted since the last pop
  static constexpr std::uint64_t kLane = (1ULL << kLaneBits) - 1;

  // A lane holds its value plus one; 0: nothing.
  static Value oldest(std::uint64_t word) { return static_cast<Value>((word & kLane) - 1); }
  static std::size_t fill(std::uint64_t word) {
    return static_cast<std::size_t>((std::bit_width(word & ~kOverflow) + kLaneBits - 1) / kLaneBits);
  }
  static std::uint64_t with(std::uint64_t word, Value value) {
    const std::uint64_t lane = std::uint64_t{value} + 1;
    if (fill(word) < N) return word | lane << kLaneBits * fill(word);
    return (word & ~kOverflow) >> kLaneBits | lane << kLaneBits * (N - 1) | kOverflow;
  }
  alignas(kCacheLine) std::atomic<std::uint64_t> pushed_{0};  // this line is written by the producer ...
  std::atomic<std::uint64_t> evicted_{0};
  std::atomic<std::size_t> high_water_{0};
  alignas(kCacheLine) std::atomic<std::uint64_t> popped_{0};  // ... this one by the consumer ...
  std::atomic<std::uint64_t> overtaken_{0};
  alignas(kCacheLine) std::atomic<std::uint64_t> word_{0};  // ... and this one by both
};

}  // namespace epiline
