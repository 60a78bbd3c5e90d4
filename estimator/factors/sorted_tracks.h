#pragma once
// The order in which the kernels process a window's tracks, eight at a time.
#include "estimator/window/window.h"

namespace epiline {

/// The tracks in use with at least two views, sorted by the first and the last frame that saw them, so that a batch of
/// eight spans few more frames than its tracks do.
class SortedTracks {
 public:
  static constexpr int kAhead = 8;  ///< tracks whose memory is prefetched before they are copied

  void sort(const Window&);
  void forget() { newest_ = 0; }
  /// True if the frames of this window were sorted.
  bool is_of(const Window& w) const { return newest_ == w.newest().id && frames_ == w.size(); }

  int size() const { return size_; }
  /// Its index in the window.
  int track(int i) const { return sorted_[i].track; }

  struct Batch {
    int begin, end;   ///< of the sorted tracks
    int first, last;  ///< frames spanned
  };
  int batches() const;
  Batch batch(int b) const;

 private:
  struct Spanned {
    std::int16_t track;
    std::int8_t first, last;
  } sorted_[kMaxTracks], found_[kMaxTracks];
  int size_ = 0;
  std::uint64_t newest_ = 0;  ///< frame; 0: none
  int frames_ = 0;
};

}  // namespace epiline
