#pragma once
// Images stamped by a camera's trigger or strobe on a GPIO line. docs/camera.md
#include <array>
#include <cstddef>
#include <string>
#include <utility>

#include "drivers/sensors/camera/edge_stamps.h"
#include "drivers/sensors/gpio/gpio_line.h"
#include "platform/concurrency/snapshot.h"

namespace epiline {

/// Hands on the edges that `line` (as GpioLine) has ready, but of one image at most kEdgesOfImage: an input that floats
/// brings new ones as fast as they are read, and the image must not wait for its end.
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

/// One thread; any may ask for counts. After open() there is no heap call.
class StampLine {
 public:
  /// As GpioLine; without a name there is none, and the driver's stamps hold.
  StampLine(std::string line, Edge edge) : is_used_(!line.empty()), line_(std::move(line), edge) {}

  Status open() { return is_used_ ? line_.open() : Status{Done{}}; }
  void close() noexcept { line_.close(); }
  /// The camera counts anew.
  void restart() noexcept { stamps_.restart(); }

  /// `start`: of the exposure by the driver's stamp; becomes that of the image's edge. False: the image is not to be
  /// used.
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
