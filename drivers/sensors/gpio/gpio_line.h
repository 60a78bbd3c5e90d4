#pragma once
// An input line and the times of its edges: a camera's trigger or strobe, an IMU's data-ready, PPS. docs/camera.md
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

/// Counters of a line.
struct GpioCounts {
  std::uint64_t edges = 0;         ///< edges delivered
  std::uint64_t lost = 0;          ///< edges that the kernel had no room for; counted with libgpiod 2 only
  std::uint64_t disconnected = 0;  ///< times the chip disappeared
  int last_error = 0;              ///< errno; 0: no error
};

/// One thread calls open(), read() and close(); any thread may call counts(). After open() that thread makes no heap
/// call. A thread of the line looks for a chip that disappeared, because libgpiod allocates and takes time.
class GpioLine {
 public:
  /// `line`: its name, or CHIP:OFFSET with the label or the name of a chip, as gpioinfo shows them.
  GpioLine(std::string line, Edge edge);
  ~GpioLine();
  GpioLine(const GpioLine&) = delete;
  GpioLine& operator=(const GpioLine&) = delete;

  /// Opens the line as an input. The error lists the lines, names the user of this one, or the missing permission.
  Status open();
  void close() noexcept;

  bool is_open() const noexcept { return opened_; }
  /// The oldest unread edges, in order, with the time of their interrupt. kSample: count > 0. kFailed, without waiting:
  /// the chip has disappeared and not returned yet.
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
