#pragma once
// A ring of small numbers (handles of large things) between one producer and one consumer in which the newest always
// finds room: a full ring gives the oldest one back to whoever pushes.
#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "platform/concurrency/spsc_ring.h"

namespace epiline {

/// `N` values, a power of two. In order and complete while it does not overflow; when it has, the consumer gets the
/// newest value at once and the others are overtaken: whoever fell behind starts afresh.
///
/// A cell is one word: serial number and value, or 0. Producer and consumer both change a cell only by exchanging its
/// word, so each value leaves the ring exactly once and into one hand: as popped, as evicted (returned by push) or as
/// overtaken (told to pop's visitor). What a value names was written before push and belongs to whoever took it out.
/// Both sides are wait-free: push is one exchange, pop at most N.
///
/// Serial s lives in cell s % N. The consumer looks for serial tail + 1 in its cell and finds
///
///     nothing      not pushed yet: the ring is empty
///     tail + 1     the next in order
///     a later one  tail + 1 was evicted. It sweeps the other cells once and keeps the newest
///     an older one left behind: pushed during such a sweep, older than what the sweep kept. Overtaken
template <std::size_t N, class Orders = SoundOrders>
class NewestRing {
  static_assert(std::has_single_bit(N), "the cell of a serial must be a mask, not a division");

 public:
  using Value = std::uint16_t;
  static constexpr Value kNone = 0xffff;

  NewestRing() = default;
  NewestRing(const NewestRing&) = delete;
  NewestRing& operator=(const NewestRing&) = delete;

  static constexpr std::size_t capacity() { return N; }

  /// Producer thread only. Returns the value that had to leave for it, or kNone. `value` is not kNone.
  Value push(Value value) noexcept {
    const std::uint64_t serial = pushed_.load(std::memory_order_relaxed) + 1;  // own counter
    // release, pairs with the acquire of take(): what the value names is complete before the consumer can have it;
    // acquire, pairs with the release of take(): the consumer is done with its turn before we reuse an evicted value
    const std::uint64_t before = cell(serial).exchange(word(serial, value), Orders::kSwap);
    pushed_.store(serial, std::memory_order_relaxed);
    const std::uint64_t waiting = serial - tail_.load(std::memory_order_relaxed);
    const std::uint64_t fill = waiting < N ? waiting : N;
    if (fill > high_water_.load(std::memory_order_relaxed)) high_water_.store(fill, std::memory_order_relaxed);
    if (before == 0) return kNone;
    bump(evicted_);
    return value_of(before);
  }

  /// Consumer thread only: false means that pop() would find nothing.
  bool ready() const noexcept {
    return cell(tail_.load(std::memory_order_relaxed) + 1).load(std::memory_order_relaxed) != 0;  // a hint
  }

  /// Consumer thread only. The next value, or kNone if there is none. `overtaken(value)` is called for values that a
  /// newer one has made pointless.
  template <class Visitor>
  Value pop(Visitor overtaken) noexcept {
    const std::uint64_t expected = tail_.load(std::memory_order_relaxed) + 1;  // own counter
    std::uint64_t best = take(expected);
    if (best == 0) return kNone;
    if (serial_of(best) < expected) {
      drop(best, overtaken);
      return kNone;
    }
    if (serial_of(best) > expected) {
      for (std::uint64_t k = 1; k < N; ++k) {
        std::uint64_t other = take(expected + k);
        if (other == 0) continue;
        if (serial_of(other) > serial_of(best)) {
          const std::uint64_t newer = other;
          other = best;
          best = newer;
        }
        drop(other, overtaken);
      }
    }
    tail_.store(serial_of(best), std::memory_order_relaxed);
    bump(popped_);
    return value_of(best);
  }

  // Any thread. Exact on the thread named, a recent value elsewhere.

  std::uint64_t pushed() const noexcept { return pushed_.load(std::memory_order_relaxed); }        ///< exact: producer
  std::uint64_t evicted() const noexcept { return evicted_.load(std::memory_order_relaxed); }      ///< exact: producer
  std::uint64_t popped() const noexcept { return popped_.load(std::memory_order_relaxed); }        ///< exact: consumer
  std::uint64_t overtaken() const noexcept { return overtaken_.load(std::memory_order_relaxed); }  ///< exact: consumer
  /// The most values that waited at once; may be one too many for a value that was just being taken.
  std::size_t high_water() const noexcept {
    return static_cast<std::size_t>(high_water_.load(std::memory_order_relaxed));
  }

 private:
  static constexpr int kValueBits = 16;  // 48 bits of serial outlast the hardware
  static std::uint64_t word(std::uint64_t serial, Value value) { return serial << kValueBits | value; }
  static std::uint64_t serial_of(std::uint64_t w) { return w >> kValueBits; }
  static Value value_of(std::uint64_t w) { return static_cast<Value>(w); }

  std::atomic<std::uint64_t>& cell(std::uint64_t serial) noexcept { return cells_[serial % N]; }
  const std::atomic<std::uint64_t>& cell(std::uint64_t serial) const noexcept { return cells_[serial % N]; }

  /// Empties the cell of a serial; the word that was in it.
  std::uint64_t take(std::uint64_t serial) noexcept {
    if (cell(serial).load(std::memory_order_relaxed) == 0) return 0;  // a hint: spares the exchange on an empty ring
    return cell(serial).exchange(0, Orders::kSwap);                   // acquire and release pair with those of push()
  }
  template <class Visitor>
  void drop(std::uint64_t w, Visitor& overtaken) noexcept {
    bump(overtaken_);
    overtaken(value_of(w));
  }
  static void bump(std::atomic<std::uint64_t>& counter) noexcept {
    counter.store(counter.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
  }

  alignas(kCacheLine) std::atomic<std::uint64_t> pushed_{0};  // this line is written by the producer ...
  std::atomic<std::uint64_t> evicted_{0}, high_water_{0};
  alignas(kCacheLine) std::atomic<std::uint64_t> tail_{0};  // ... this one by the consumer ...
  std::atomic<std::uint64_t> popped_{0}, overtaken_{0};
  alignas(kCacheLine) std::array<std::atomic<std::uint64_t>, N> cells_{};  // ... and these by both
};

}  // namespace epiline
