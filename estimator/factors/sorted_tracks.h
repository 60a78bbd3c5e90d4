#pragma once
// The order in which the kernels process a window's tracks, eight at a time.
#include "estimator/factors/kernels.h"
#include "estimator/window/window.h"

namespace epiline {

/// The tracks in use with at least two views, sorted by their cameras, and then by the first and the last frame that
/// saw them, so that a batch of eight spans few more frames than its tracks do. A batch's tracks belong to one camera,
/// and no more than one other camera sees them, too. All batches that hold frame 0's tracks stand side by side: before
/// them are those of the other cameras, after them those of the first one, whose tracks are sorted from the first frame
/// to the last.
class SortedTracks {
 public:
  static constexpr int kAhead = 8;  ///< tracks whose memory is prefetched before they are copied

  /// `with_others`: take the tracks of cameras other than the first one, too.
  void sort(const Window&, bool with_others = false);
  void forget() { newest_ = 0; }
  /// True if the frames of this window were sorted.
  bool is_of(const Window& w) const { return newest_ == w.newest().id && frames_ == w.size(); }

  struct Spanned {
    std::uint32_t seen;  ///< bit k: by frame k
    std::int16_t track;  ///< its index in the window
    std::int16_t key;    ///< by which they are sorted
    std::int8_t first, last;
  };
  int size() const { return size_; }
  const Spanned& spanned(int i) const { return sorted_[i]; }
  int track(int i) const { return sorted_[i].track; }

  struct Batch {
    int begin, end;     ///< of the sorted tracks
    int first, last;    ///< frames spanned
    int camera;         ///< whose tracks they are
    int second_camera;  ///< behind it, of which some have views; 0: none
  };
  int batches() const { return batches_; }
  const Batch& batch(int b) const { return batch_[b]; }
  /// How many batches of other cameras there are: as many stand before the first camera's.
  int batches_of_others() const { return of_others_; }

 private:
  Spanned sorted_[kMaxTracks], found_[kMaxTracks];
  Batch batch_[kMaxBatches];
  int size_ = 0, batches_ = 0, of_others_ = 0;
  std::uint64_t newest_ = 0;  ///< frame; 0: none
  int frames_ = 0;

  void find(const Window&, bool with_others);
  void cut(const int* begin_of, int pairs);
};

}  // namespace epiline
