#pragma once
// Events of several threads in the order of their time.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "platform/log/event.h"

namespace epiline {

/// Holds at most `N` events back, so that one that comes late still finds its place. In one thread; no heap.
template <std::size_t N>
class EventMerge {
 public:
  /// False, and nothing changed, if and only if it is full.
  bool add(const Event& event) noexcept {
    if (size_ == N) return false;
    entries_[size_++] = {event, added_++};
    std::push_heap(entries_.begin(), end(), later);
    return true;
  }

  /// Takes out the earliest event (of several at one instant the one added first) if it is not after `until`.
  bool take(HostStamp until, Event& event) noexcept {
    if (size_ == 0 || entries_.front().event.stamp > until) return false;
    event = entries_.front().event;
    std::pop_heap(entries_.begin(), end(), later);
    --size_;
    return true;
  }

  std::size_t size() const noexcept { return size_; }

 private:
  struct Entry {
    Event event;
    std::uint64_t serial = 0;
  };
  static bool later(const Entry& a, const Entry& b) noexcept {
    return a.event.stamp != b.event.stamp ? a.event.stamp > b.event.stamp : a.serial > b.serial;
  }
  auto end() noexcept { return entries_.begin() + static_cast<std::ptrdiff_t>(size_); }

  std::array<Entry, N> entries_{};
  std::size_t size_ = 0;
  std::uint64_t added_ = 0;
};

}  // namespace epiline
