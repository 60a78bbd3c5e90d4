#include "pipeline/recorder/tape.h"

#include <algorithm>

#include "platform/concurrency/counter.h"
#include "platform/error/contract.h"

namespace epiline {

Tape::Tape(std::size_t segments, std::size_t kept, std::size_t segment_bytes)
    : segment_bytes_((segment_bytes + 7) / 8 * 8), kept_(kept), memory_(segments * segment_bytes_), used_(segments) {
  EPILINE_EXPECTS(kept >= 1 && kept < segments, "there must be segments to go on with");
}

bool Tape::next_segment() noexcept {
  const std::uint64_t next = current_ + 1;
  // acquire, pairs with the release in done_before()
  const std::uint64_t needed = needed_from_.load(std::memory_order_acquire);
  if (needed != kNothing && next >= needed + used_.size()) return false;
  current_ = next;
  used_[current_ % used_.size()] = 0;
  return true;
}

std::byte* Tape::claim(std::uint32_t kind, std::size_t bytes) noexcept {
  const std::size_t wanted = bytes_of_record(bytes);
  const bool fits = wanted <= segment_bytes_;
  if (!fits || (used_[current_ % used_.size()] + wanted > segment_bytes_ && !next_segment())) {
    bump(lost_);
    return nullptr;
  }
  const std::size_t slot = current_ % used_.size();
  std::byte* const at = memory_.data() + slot * segment_bytes_ + used_[slot];
  const Header header{static_cast<std::uint32_t>(bytes), kind};
  std::memcpy(at, &header, sizeof header);
  claimed_ = wanted;
  return at + kHeader;
}

void Tape::commit() noexcept { used_[current_ % used_.size()] += claimed_; }

Tape::Range Tape::lend() noexcept {
  const bool moved = next_segment();
  EPILINE_EXPECTS(moved, "the tape is lent once at a time");
  const Range range{current_ - std::min<std::uint64_t>(current_, kept_), current_};
  // relaxed: handing the range to the reader orders it, and until then only this thread reads the number
  needed_from_.store(range.from, std::memory_order_relaxed);
  return range;
}

}  // namespace epiline
