#pragma once
// An input line and the times of its edges: a camera's trigger or strobe, an IMU's data-ready, PPS. docs/gpio.md
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "platform/concurrency/parking.h"
#include "platform/error/result.h"
#include "platform/linux/realtime.h"
#include "platform/ports/ports.h"
#include "platform/time/clock.h"

namespace epiline {

enum class Edge : std::uint8_t { kRising, kFalling };  ///< as kEdgeNames

/// For `check` and for health.
struct GpioCounts {
  std::uint64_t edges = 0;         ///< handed out
  std::uint64_t lost = 0;          ///< the kernel had no room for them. Only with libgpiod 2: before, nobody knows
  std::uint64_t disconnected = 0;  ///< the chip went away
  int last_error = 0;              ///< errno; 0: the line is well
};

/// One thread calls open(), read() and close(); any thread may ask for counts. After open() that thread makes no heap
/// call. A chip that went away is looked for by a thread of the line's own, for libgpiod allocates and takes its time.
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

  bool is_open() const noexcept { return opened_; }
  /// The oldest edges not yet read, in order, as instants of the interrupt. kSample: count > 0; kFailed, without
  /// waiting: the chip is gone, and not back yet.
  ReadOutcome read(std::span<HostStamp> edges, std::size_t& count, Span timeout) noexcept;
  GpioCounts counts() const noexcept;

 private:
  struct Request;  ///< libgpiod's part, one for each version

  Status connect();
  static void keep(void* self);
  void lose(int error) noexcept;

  std::string line_;
  Edge edge_;
  bool opened_ = false;
  std::unique_ptr<Request> request_;  ///< the keeper's while is_lost_
  std::atomic<bool> is_lost_{false}, ends_{false};
  Parking keeper_wakes_;
  RealtimeThread keeper_;
  std::atomic<std::uint64_t> edges_{0}, lost_{0}, disconnected_{0};
  std::atomic<int> last_error_{0};
};

}  // namespace epiline
