#pragma once
// Edges of GPIO lines: those that stamp images, and those of a line whose device is not there.
#include <mutex>
#include <string>

#include "drivers/program/check/finding.h"
#include "drivers/program/check/pacing.h"
#include "drivers/program/check/watcher.h"
#include "drivers/sensors/camera/edge_stamps.h"
#include "drivers/sensors/gpio/gpio_line.h"

namespace epiline {

/// Takes edges from construction on, in a thread of its own.
class LineCheck {
 public:
  /// `line` is open, and outlives this.
  explicit LineCheck(GpioLine& line) : line_(line), thread_([this] { return look(); }) {}
  PacingResult so_far();

 private:
  bool look();

  GpioLine& line_;
  std::mutex mutex_;
  Pacing pacing_;
  Watcher thread_;  // last: it uses the others
};

/// `device`: whose line it is.
Findings findings_of(const PacingResult& edges, const std::string& device, const std::string& line);
/// Of a camera that runs: do edges and images agree?
Findings findings_of(const EdgeCounts& edges, const GpioCounts& counts, const std::string& line);

}  // namespace epiline
