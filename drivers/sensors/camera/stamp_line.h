#pragma once
// Images stamped by a camera's trigger or strobe on a GPIO line. docs/camera.md
#include <string>
#include <utility>

#include "drivers/sensors/camera/edge_stamps.h"
#include "drivers/sensors/gpio/gpio_line.h"
#include "platform/concurrency/snapshot.h"

namespace epiline {

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
