#pragma once
// The order in which the kernels process a window's tracks, eight at a time.
#include "estimator/simd/instruction_set.h"
#include "estimator/window/window.h"

namespace epiline {

/// The tracks in use with at least two views, sorted by the first and the last frame that saw them, so that a batch of
/// eight spans few more frames than its tracks do. Tracks of the second camera alone have batches of their own, the
/// first ones, from the last frame to the first: so all batches that hold frame 0's tracks stand side by side.
class SortedTracks {
 public:
  static constexpr int kAhead = 8;  ///< tracks whose memory is prefetched before they are copied

  /// `with_second`: take the tracks of the second camera alone, too.
  void sort(const Window&, bool with_second = false);
  void forget() { newest_ = 0; }
  /// True if the frames of this window were sorted.
  bool is_of(const Window& w) const { return newest_ == w.newest().id && frames_ == w.size(); }

  int size() const { return size_; }
  /// Its index in the window.
  int track(int i) const { return sorted_[i].track; }

  struct Batch {
    int begin, end;   ///< of the sorted tracks
    int first, last;  ///< frames spanned
    bool by_second;
  };
  int by_second_batches() const { return batches_of(size_ - by_first_); }
  int batches() const { return by_second_batches() + by_first_batches(); }
  Batch batch(int b) const;

 private:
  static int batches_of(int tracks) { return (tracks + kBatchLanes - 1) / kBatchLanes; }
  int by_first_batches() const { return batches_of(by_first_); }

  struct Spanned {
    std::int16_t track;
    std::int16_t key;  ///< by which they are sorted
    std::int8_t first, last;
  } sorted_[kMaxTracks], found_[kMaxTracks];
  int size_ = 0, by_first_ = 0;  ///< by_first_: so many are the first camera's
  std::uint64_t newest_ = 0;     ///< frame; 0: none
  int frames_ = 0;
};

}  // namespace epiline
