#pragma once
// The newest value, from one writer thread to one reader thread. Values that were not read in time are overwritten.
#include <array>
#include <atomic>
#include <cstdint>
#include <type_traits>

#include "platform/concurrency/spsc_ring.h"

namespace epiline {

/// A triple buffer: the writer fills its slot and swaps it with the middle one, the reader swaps its slot with the
/// middle one when that is fresh. No slot is ever open to both, so no value is torn, and both sides are wait-free (one
/// exchange).
template <class T, class Orders = SoundOrders>
class LatestValue {
  static_assert(std::is_nothrow_default_constructible_v<T> && std::is_nothrow_copy_assignable_v<T>);

 public:
  LatestValue() = default;
  LatestValue(const LatestValue&) = delete;
  LatestValue& operator=(const LatestValue&) = delete;

  /// Writer thread only: the slot to fill before publish(). It holds some older value.
  T& draft() noexcept { return slots_[writer_slot_].value; }
  /// Writer thread only: makes the draft the newest value.
  void publish() noexcept {
    // release, pairs with the acquire of read(): the value is complete before its slot can be taken;
    // acquire, pairs with the release of read(): the reader is done with the slot before it is written again
    writer_slot_ = middle_.exchange(writer_slot_ | kFresh, Orders::kSwap) & kSlotMask;
  }
  void write(const T& value) noexcept {
    draft() = value;
    publish();
  }

  /// Reader thread only: the newest value, valid until the next call; null if and only if none was published yet.
  const T* read() noexcept {
    if ((middle_.load(std::memory_order_relaxed) & kFresh) != 0) {  // a hint; the exchange below decides and orders
      // acquire and release pair with those of publish()
      reader_slot_ = middle_.exchange(reader_slot_, Orders::kSwap) & kSlotMask;
      has_value_ = true;
    }
    return has_value_ ? &slots_[reader_slot_].value : nullptr;
  }

 private:
  static constexpr std::uint32_t kFresh = 4;
  static constexpr std::uint32_t kSlotMask = 3;

  struct alignas(kCacheLine) Slot {
    T value{};
  };

  std::array<Slot, 3> slots_{};
  alignas(kCacheLine) std::atomic<std::uint32_t> middle_{1};
  alignas(kCacheLine) std::uint32_t writer_slot_ = 0;
  alignas(kCacheLine) std::uint32_t reader_slot_ = 2;
  bool has_value_ = false;
};

}  // namespace epiline
