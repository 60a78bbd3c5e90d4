#pragma once
// Checks the edges of GPIO lines that stamp images, and of lines whose device is missing.
#include <mutex>
#include <optional>
#include <string>

#include "drivers/program/check/finding.h"
#include "drivers/program/check/pacing.h"
#include "drivers/program/check/watcher.h"
#include "drivers/sensors/camera/edge_stamps.h"
#include "drivers/sensors/gpio/gpio_line.h"

namespace epiline {

/// Counts the edges of a line that stamps for a device which does not run, from open() on, in a thread of its own.
class LineCheck {
 public:
  LineCheck(const std::string& line, Edge edge) : line_(line, edge) {}
  Status open();
  PacingResult so_far();

 private:
  bool look();

  GpioLine line_;
  std::mutex mutex_;
  Pacing pacing_;
  std::optional<Watcher> thread_;  // last: it uses the others
};

/// `device`: name of the device on the line.
Findings findings_of(const PacingResult& edges, const std::string& device, const std::string& line);
/// For a running camera: whether edges and images agree.
Findings findings_of(const EdgeCounts& edges, const GpioCounts& counts, const std::string& line);

}  // namespace epiline
