#pragma once
// Checks the timestamp and the contents of every image before its use. Rules: docs/derivations/health.md.
#include <array>
#include <cstdint>

#include "pipeline/watch/stamp_gate.h"
#include "platform/samples/samples.h"

namespace epiline {

struct ImageGateStats {
  std::uint64_t suspect = 0, old = 0, clock_steps = 0, frozen = 0, covered = 0, obstructed = 0, exposure_steps = 0;
  std::uint64_t copies = 0;  ///< of the image before, with a new timestamp; left out
};

/// No clock, no heap. The same images give the same verdicts.
class ImageGate {
 public:
  /// Corrects the timestamp and sets `image.reasons`. False: leave the image out. An image without pixels (recorded
  /// tracks) is judged by its timestamp alone.
  bool step(Frame& image) noexcept;

  const ImageGateStats& stats() const noexcept { return stats_; }
  Span correction() const noexcept { return clock_.correction(); }

 private:
  static constexpr int kCellsX = 8, kCellsY = 6, kPerCell = 8;  // 64 pixels of each cell
  struct Look {
    std::uint64_t fingerprint = 0;  ///< of every tenth row or so
    double mean = 0;
    double flat = 0;  ///< share of the cells without contrast
  };
  static Look look_at(const Frame& image) noexcept;
  bool in_order(Frame& image) noexcept;
  bool is_copy(const Look& look) noexcept;
  void judge(const Look& look, HostStamp stamp, std::uint32_t& reasons) noexcept;

  StampGate clock_;
  ImageGateStats stats_;
  Look last_;
  int same_ = 0;  ///< images in a row that equal the one before
  bool any_ = false;
  double usual_flat_ = 0;  ///< follows slowly
  bool obstructed_ = false;
  HostStamp last_stamp_;
  std::uint32_t pending_ = 0;
};

}  // namespace epiline
