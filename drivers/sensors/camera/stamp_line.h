#pragma once
// Timestamps images by the camera's trigger or strobe on a GPIO line. docs/camera.md
#include <array>
#include <cstddef>
#include <string>
#include <utility>

#include "drivers/sensors/camera/edge_stamps.h"
#include "drivers/sensors/gpio/gpio_line.h"
#include "platform/concurrency/snapshot.h"

namespace epiline {

/// Passes on the pending edges of `line` (as GpioLine), at most kEdgesOfImage for one image. A floating input delivers
/// edges as fast as they are read, and the image must not wait for the last one.
inline constexpr std::size_t kEdgesOfImage = 256;  ///< all that the kernel keeps for us
template <class Line>
void take_edges(Line& line, EdgeStamps& stamps) noexcept {
  std::array<HostStamp, 32> edges;
  std::size_t count = 0;
  // a line that has gone gives no edges until it is back: the driver's stamps go on, less their lag
  for (std::size_t taken = 0; taken < kEdgesOfImage; taken += count) {
    if (!line.is_open() || line.read(edges, count, Span{0}) != ReadOutcome::kSample) return;
    for (std::size_t i = 0; i < count; ++i) stamps.add_edge(edges[i]);
  }
}

/// One thread; any thread may read the counters. No heap after open().
class StampLine {
 public:
  /// `line`: as GpioLine takes it; empty: no line, the driver's timestamps are used.
  StampLine(std::string line, Edge edge) : is_used_(!line.empty()), line_(std::move(line), edge) {}

  Status open() { return is_used_ ? line_.open() : Status{Done{}}; }
  void close() noexcept { line_.close(); }
  /// Call when the camera's sequence numbers restart.
  void restart() noexcept { stamps_.restart(); }

  /// Replaces `start`, the start of the exposure by the driver's timestamp, by the time of the image's edge. False: do
  /// not use the image.
  bool stamp(std::uint64_t sequence, HostStamp& start) noexcept;

  EdgeCounts counts() const noexcept { return counts_.read(); }
  GpioCounts line_counts() const noexcept { return line_.counts(); }

 private:
  bool is_used_;
  GpioLine line_;
  EdgeStamps stamps_;
  HostStamp newest_;  ///< handed out
  Snapshot<EdgeCounts> counts_;
};

}  // namespace epiline
