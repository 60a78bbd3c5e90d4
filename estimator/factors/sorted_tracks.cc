#include "estimator/factors/sorted_tracks.h"

#include <algorithm>
#include <bit>

namespace epiline {

namespace {
constexpr int kSpans = kMaxFrames * kMaxFrames;  // pairs of a first and a last frame

/// Cameras whose tracks stand in batches of their own. Tracks without a second camera are among those of the next one.
struct CameraPair {
  int camera, second_camera;
};
constexpr CameraPair kPairs[kCameraPairs] = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}, {3, 0}};

int pair_of(const TrackRecord& t) {
  constexpr int kFirstPair[kMaxCameras] = {0, 3, 5, 6};
  return kFirstPair[t.camera] + (t.second_camera > 0 ? t.second_camera - t.camera - 1 : 0);
}
}  // namespace

void SortedTracks::sort(const Window& w, bool with_others) {
  newest_ = w.newest().id;
  frames_ = w.size();
  find(w, with_others);
  std::int16_t begin[kCameraPairs * kSpans + 1];
  const int pairs = with_others ? kCameraPairs : 1, keys = pairs * kSpans;
  std::fill_n(begin, keys + 1, std::int16_t{0});
  for (int i = 0; i < size_; ++i) ++begin[found_[i].key + 1];
  for (int c = 0; c < keys; ++c) begin[c + 1] = static_cast<std::int16_t>(begin[c + 1] + begin[c]);
  int begin_of[kCameraPairs + 1];
  for (int p = 0; p <= pairs; ++p) begin_of[p] = begin[p * kSpans];
  for (int i = 0; i < size_; ++i) sorted_[begin[found_[i].key]++] = found_[i];
  cut(begin_of, pairs);
}

void SortedTracks::find(const Window& w, bool with_others) {
  size_ = 0;
  std::int8_t frame_of[32];
  for (int k = 0; k < w.size(); ++k) frame_of[std::countr_zero(w.bit(k))] = static_cast<std::int8_t>(k);
  for (int i = 0; i < w.track_count(); ++i) {
    const TrackRecord& t = w.track(i);
    if (!t.in_use || std::popcount(t.mask) < 2 || (t.camera > 0 && !with_others)) continue;
    std::uint32_t seen = 0;
    for (std::uint32_t mask = t.mask; mask != 0; mask &= mask - 1) seen |= 1u << frame_of[std::countr_zero(mask)];
    const int first = std::countr_zero(seen), last = 31 - std::countl_zero(seen), pair = with_others ? pair_of(t) : 0;
    found_[size_++] = {seen, static_cast<std::int16_t>(i),
                       static_cast<std::int16_t>(pair * kSpans + kMaxFrames * first + last),
                       static_cast<std::int8_t>(first), static_cast<std::int8_t>(last)};
  }
}

/// Each pair of cameras' tracks are cut into batches, which are put in order by what marginalisation takes.
void SortedTracks::cut(const int* begin_of, int pairs) {
  Batch cut[kMaxBatches];
  int n = 0;
  for (int p = 0; p < pairs; ++p)
    for (int begin = begin_of[p]; begin < begin_of[p + 1]; begin += kBatchLanes) {
      const int end = std::min(begin_of[p + 1], begin + kBatchLanes);
      int last = 0;
      for (int i = begin; i < end; ++i) last = std::max<int>(last, sorted_[i].last);
      cut[n++] = {begin, end, sorted_[begin].first, last, kPairs[p].camera, kPairs[p].second_camera};
    }
  batches_ = 0;
  const auto take = [&](const Batch& b, bool of_others, bool oldest) {
    if ((b.camera > 0) == of_others && (b.first == 0) == oldest) batch_[batches_++] = b;
  };
  for (const bool oldest : {false, true})
    for (int b = n - 1; b >= 0; --b) take(cut[b], true, oldest);
  of_others_ = batches_;
  for (const bool oldest : {true, false})
    for (int b = 0; b < n; ++b) take(cut[b], false, oldest);
}

}  // namespace epiline
