#pragma once
// What happens on the hot path is logged as fixed binary events through a ring; another thread turns them into text.
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "platform/concurrency/spsc_ring.h"
#include "platform/time/clock.h"

namespace epiline {

/// The arguments of each event, in order, are named in event.cc.
enum class EventId : std::uint16_t {
  kImageDropped,
  kImuGap,
  kImuRefused,
  kDeadlineMissed,
  kHealthChanged,
  kReset,
  kSourceLost,
  kSourceFound,
  kCount
};

struct Event {
  HostStamp stamp;
  EventId id = EventId::kCount;
  std::array<std::int64_t, 3> args{};
};

using EventRing = SpscRing<Event, 1024>;

/// Writes `SECONDS name argument=value ...` with a final zero into `text`, cut to its size. Returns the characters
/// written, the zero not counted. No heap.
std::size_t format_event(const Event& event, std::span<char> text) noexcept;

}  // namespace epiline
