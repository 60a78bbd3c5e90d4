#include "estimator/factors/sorted_tracks.h"

#include <algorithm>
#include <bit>

#include "estimator/simd/instruction_set.h"

namespace epiline {

void SortedTracks::sort(const Window& w) {
  newest_ = w.newest().id;
  frames_ = w.size();
  size_ = 0;
  std::int16_t begin[kMaxFrames * kMaxFrames + 1] = {};
  std::int8_t frame_of[32];
  for (int k = 0; k < w.size(); ++k) frame_of[std::countr_zero(w.bit(k))] = static_cast<std::int8_t>(k);
  for (int i = 0; i < w.track_count(); ++i) {
    const TrackRecord& t = w.track(i);
    if (!t.in_use || std::popcount(t.mask) < 2) continue;
    std::int8_t first = kMaxFrames, last = -1;
    for (std::uint32_t mask = t.mask; mask != 0; mask &= mask - 1) {
      const std::int8_t k = frame_of[std::countr_zero(mask)];
      first = std::min(first, k);
      last = std::max(last, k);
    }
    found_[size_++] = {static_cast<std::int16_t>(i), first, last};
    ++begin[kMaxFrames * first + last + 1];
  }
  for (int c = 0; c < kMaxFrames * kMaxFrames; ++c) begin[c + 1] = static_cast<std::int16_t>(begin[c + 1] + begin[c]);
  for (int i = 0; i < size_; ++i) sorted_[begin[kMaxFrames * found_[i].first + found_[i].last]++] = found_[i];
}

int SortedTracks::batches() const { return (size_ + kBatchLanes - 1) / kBatchLanes; }

SortedTracks::Batch SortedTracks::batch(int b) const {
  const int begin = b * kBatchLanes, end = std::min(size_, begin + kBatchLanes);
  int last = 0;
  for (int i = begin; i < end; ++i) last = std::max<int>(last, sorted_[i].last);
  return {begin, end, sorted_[begin].first, last};
}

}  // namespace epiline
