#include "drivers/sensors/camera/stamp_line.h"

namespace epiline {

bool StampLine::stamp(std::uint64_t sequence, HostStamp& start) noexcept {
  if (!is_used_) return true;
  take_edges(line_, stamps_);
  const EdgeMatch match = stamps_.match(sequence, start);
  counts_.write(stamps_.counts());
  if ((match != EdgeMatch::kEdge && match != EdgeMatch::kNoEdge) || start <= newest_) return false;
  newest_ = start;
  return true;
}

}  // namespace epiline
