#include "estimator/factors/sorted_tracks.h"

#include <algorithm>
#include <bit>

namespace epiline {

namespace {
constexpr int kSpans = kMaxFrames * kMaxFrames;  // pairs of a first and a last frame
}  // namespace

void SortedTracks::sort(const Window& w, bool with_second) {
  newest_ = w.newest().id;
  frames_ = w.size();
  size_ = 0;
  std::int16_t begin[2 * kSpans + 1] = {};
  const int kinds = with_second ? 2 : 1;
  std::int8_t frame_of[32];
  for (int k = 0; k < w.size(); ++k) frame_of[std::countr_zero(w.bit(k))] = static_cast<std::int8_t>(k);
  for (int i = 0; i < w.track_count(); ++i) {
    const TrackRecord& t = w.track(i);
    if (!t.in_use || std::popcount(t.mask) < 2 || (t.by_second && !with_second)) continue;
    std::int8_t first = kMaxFrames, last = -1;
    for (std::uint32_t mask = t.mask; mask != 0; mask &= mask - 1) {
      const std::int8_t k = frame_of[std::countr_zero(mask)];
      first = std::min(first, k);
      last = std::max(last, k);
    }
    const auto kind = static_cast<std::int16_t>(t.by_second ? kSpans : 0);
    found_[size_++] = {static_cast<std::int16_t>(i), static_cast<std::int16_t>(kind + kMaxFrames * first + last), first,
                       last};
    ++begin[found_[size_ - 1].key + 1];
  }
  for (int c = 0; c < kinds * kSpans; ++c) begin[c + 1] = static_cast<std::int16_t>(begin[c + 1] + begin[c]);
  by_first_ = begin[kSpans];
  for (int i = 0; i < size_; ++i) sorted_[begin[found_[i].key]++] = found_[i];
}

SortedTracks::Batch SortedTracks::batch(int b) const {
  const int seconds = by_second_batches();
  const bool by_second = b < seconds;
  const int begin = by_second ? by_first_ + (seconds - 1 - b) * kBatchLanes : (b - seconds) * kBatchLanes;
  const int end = std::min(by_second ? size_ : by_first_, begin + kBatchLanes);
  int last = 0;
  for (int i = begin; i < end; ++i) last = std::max<int>(last, sorted_[i].last);
  return {begin, end, sorted_[begin].first, last, by_second};
}

}  // namespace epiline
