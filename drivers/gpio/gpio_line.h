#pragma once
// An input line and the times of its edges: a camera's trigger or strobe, an IMU's data-ready, PPS. docs/gpio.md
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "platform/error/result.h"
#include "platform/ports/ports.h"
#include "platform/time/clock.h"

namespace epiline {

enum class Edge : std::uint8_t { kRising, kFalling };  ///< as kEdgeNames

/// For `check` and for health.
struct GpioCounts {
  std::uint64_t edges = 0;  ///< handed out
  std::uint64_t lost = 0;   ///< the kernel had no room for them. Only with libgpiod 2: before, nobody knows
  int last_error = 0;       ///< errno; 0: the line is well
};

/// One thread calls open(), read() and close(); any thread may ask for counts. After open() there is no heap call.
class GpioLine {
 public:
  /// `line`: its name, or CHIP:OFFSET with the label or the name of a chip, as gpioinfo shows them.
  GpioLine(std::string line, Edge edge);
  ~GpioLine();
  GpioLine(const GpioLine&) = delete;
  GpioLine& operator=(const GpioLine&) = delete;

  /// Takes the line as an input. Says which lines there are, who uses this one, or which permission is missing.
  Status open();
  void close() noexcept;

  /// For poll(), beside others; -1: not open.
  int fd() const noexcept { return fd_; }
  /// The oldest edges not yet read, in order, as instants of the interrupt. kSample: count > 0; kFailed: the chip is
  /// gone; open() again.
  ReadOutcome read(std::span<HostStamp> edges, std::size_t& count, Span timeout) noexcept;
  GpioCounts counts() const noexcept;

 private:
  struct Request;  ///< libgpiod's part, one for each version

  std::string line_;
  Edge edge_;
  std::unique_ptr<Request> request_;
  int fd_ = -1;
  std::atomic<std::uint64_t> edges_{0}, lost_{0};
  std::atomic<int> last_error_{0};
};

}  // namespace epiline
