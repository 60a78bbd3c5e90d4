#include "drivers/sensors/camera/stamp_line.h"

#include <array>

namespace epiline {

bool StampLine::stamp(std::uint64_t sequence, HostStamp& start) noexcept {
  if (!is_used_) return true;
  std::array<HostStamp, 32> edges;
  std::size_t count = 0;
  // a line that has gone gives no edges until it is back: the driver's stamps go on, less their lag
  while (line_.is_open() && line_.read(edges, count, Span{0}) == ReadOutcome::kSample)
    for (std::size_t i = 0; i < count; ++i) stamps_.add_edge(edges[i]);
  const EdgeMatch match = stamps_.match(sequence, start);
  counts_.write(stamps_.counts());
  if ((match != EdgeMatch::kEdge && match != EdgeMatch::kNoEdge) || start <= newest_) return false;
  newest_ = start;
  return true;
}

}  // namespace epiline
