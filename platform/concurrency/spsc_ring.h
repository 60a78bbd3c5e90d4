#pragma once
// A ring between exactly one producer thread and one consumer thread. Every call is wait-free: no loop, no lock, no
// system call. Elements live in the ring; large ones are written and read in place and never copied.
#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "platform/concurrency/counter.h"

namespace epiline {

inline constexpr std::size_t kCacheLine = 64;  ///< bytes; x86-64 and the aarch64 cores we know

/// The memory orders of a ring or box. Only tests use others: to see the thread sanitizer object.
struct SoundOrders {
  static constexpr std::memory_order kPublish = std::memory_order_release;
  static constexpr std::memory_order kObserve = std::memory_order_acquire;
  static constexpr std::memory_order kRelease = std::memory_order_release;
  static constexpr std::memory_order kReclaim = std::memory_order_acquire;
  static constexpr std::memory_order kSwap = std::memory_order_acq_rel;  // of LatestValue and Loans
};

/// `N` elements, a power of two. A full ring refuses the newest element and counts it as dropped.
///
/// Both indices only ever grow (64 bits outlast the hardware); element i lives in slot i % N. The producer owns the
/// slots [head, tail + N), the consumer owns [tail, head). Each side keeps the last index it saw of the other side on
/// its own cache line and asks again only when that one is not enough, so a busy ring moves few lines between cores.
template <class T, std::size_t N, class Orders = SoundOrders>
class SpscRing {
  static_assert(std::has_single_bit(N), "the slot of an index must be a mask, not a division");
  static_assert(std::is_nothrow_default_constructible_v<T> && std::is_nothrow_copy_assignable_v<T>);

 public:
  SpscRing() = default;
  SpscRing(const SpscRing&) = delete;
  SpscRing& operator=(const SpscRing&) = delete;

  static constexpr std::size_t capacity() { return N; }

  // Producer thread only.

  /// The slot of the next element, to be filled and then published; null, and one more drop, if and only if the ring is
  /// full. It still holds an old element.
  T* claim() noexcept {
    const std::uint64_t head = producer_.head.load(std::memory_order_relaxed);  // own index
    if (head - producer_.tail_seen == N) {
      // pairs with the store in pop(): the consumer's last look at the slot comes before it is written again
      producer_.tail_seen = consumer_.tail.load(Orders::kReclaim);
      if (head - producer_.tail_seen == N) {
        bump(producer_.dropped);
        return nullptr;
      }
    }
    return &slots_[head % N];
  }

  /// Hands the claimed element over. Once per successful claim().
  void publish() noexcept {
    const std::uint64_t head = producer_.head.load(std::memory_order_relaxed) + 1;  // own index
    note_fill(head);
    // pairs with the load in front(): the element is complete before the consumer can see its index
    producer_.head.store(head, Orders::kPublish);
  }

  /// Copies `value` in; false if and only if the ring is full.
  bool push(const T& value) noexcept {
    T* const slot = claim();
    if (slot == nullptr) return false;
    *slot = value;
    publish();
    return true;
  }

  // Consumer thread only.

  /// The oldest element, to be read (or changed) in place and then popped; null if and only if the ring is empty.
  T* front() noexcept {
    const std::uint64_t tail = consumer_.tail.load(std::memory_order_relaxed);  // own index
    if (tail == consumer_.head_seen) {
      // pairs with the store in publish(): an index that is seen leads to a complete element
      consumer_.head_seen = producer_.head.load(Orders::kObserve);
      if (tail == consumer_.head_seen) return nullptr;
    }
    return &slots_[tail % N];
  }

  /// Gives the slot of front() back. Once per non-null front(); the pointer is void afterwards.
  void pop() noexcept {
    const std::uint64_t tail = consumer_.tail.load(std::memory_order_relaxed);  // own index
    // pairs with the load in claim(): we are done with the slot before the producer can claim it
    consumer_.tail.store(tail + 1, Orders::kRelease);
  }

  /// Copies the oldest element out and pops it; false if and only if the ring is empty.
  bool pop(T& out) noexcept {
    const T* const value = front();
    if (value == nullptr) return false;
    out = *value;
    pop();
    return true;
  }

  // Any thread. Exact on the thread named, a recent value elsewhere; no order with other memory is implied.

  /// Elements refused because the ring was full (exact: producer).
  std::uint64_t dropped() const noexcept { return producer_.dropped.load(std::memory_order_relaxed); }
  /// The most elements that were ever in the ring, as the producer found it when publishing (exact: producer).
  std::size_t high_water() const noexcept {
    return static_cast<std::size_t>(producer_.high_water.load(std::memory_order_relaxed));
  }
  /// Elements published so far, dropped ones not included (exact: producer).
  std::uint64_t published() const noexcept { return producer_.head.load(std::memory_order_relaxed); }
  /// Elements popped so far (exact: consumer).
  std::uint64_t popped() const noexcept { return consumer_.tail.load(std::memory_order_relaxed); }

 private:
  struct alignas(kCacheLine) Producer {
    std::atomic<std::uint64_t> head{0};
    std::uint64_t tail_seen = 0;
    std::atomic<std::uint64_t> dropped{0};     // atomic for its readers; one writer
    std::atomic<std::uint64_t> high_water{0};  // likewise
  };
  struct alignas(kCacheLine) Consumer {
    std::atomic<std::uint64_t> tail{0};
    std::uint64_t head_seen = 0;
  };
  static_assert(sizeof(Producer) == kCacheLine && sizeof(Consumer) == kCacheLine,
                "one line a side, shared with nobody");
  static_assert(std::atomic<std::uint64_t>::is_always_lock_free);

  // `tail_seen` may be old, and the fill it suggests too large. Only a would-be record is worth another look.
  void note_fill(std::uint64_t head) noexcept {
    const std::uint64_t record = producer_.high_water.load(std::memory_order_relaxed);
    if (head - producer_.tail_seen <= record) return;
    producer_.tail_seen = consumer_.tail.load(Orders::kReclaim);  // as in claim(), which may rely on it later
    if (head - producer_.tail_seen > record) {
      producer_.high_water.store(head - producer_.tail_seen, std::memory_order_relaxed);
    }
  }

  Producer producer_;
  Consumer consumer_;
  alignas(kCacheLine) std::array<T, N> slots_{};
};

}  // namespace epiline
