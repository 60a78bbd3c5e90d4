#pragma once
// A ground vehicle's speed from its CAN bus. Page: docs/can.md.
#include <cstdint>
#include <span>

#include "drivers/links/can/can_socket.h"
#include "drivers/sensors/wheel/arrival_clock.h"
#include "drivers/sensors/wheel/bus_signal.h"
#include "pipeline/config/devices.h"
#include "platform/concurrency/snapshot.h"
#include "platform/ports/counter.h"
#include "platform/ports/ports.h"
#include "platform/time/backoff.h"

namespace epiline {

struct WheelCounts {
  std::uint64_t samples = 0;       ///< handed out
  std::uint64_t too_short = 0;     ///< frames without room for the signal
  std::uint64_t not_finite = 0;    ///< frames whose number is none
  std::uint64_t bad_stamps = 0;    ///< stamped when read: the kernel said nothing, or nothing to be believed
  std::uint64_t gaps = 0;          ///< times without a frame for more than three usual intervals
  std::uint64_t overruns = 0;      ///< frames the kernel lost because we were too slow
  std::uint64_t disconnected = 0;  ///< the interface went down or away
  std::uint64_t retries = 0;       ///< attempts to get it back that failed
  int last_error = 0;              ///< errno of the last loss or failed attempt
};
inline constexpr auto kWheelCounters = std::to_array<Counter<WheelCounts>>({
    {"samples", &WheelCounts::samples},
    {"too_short", &WheelCounts::too_short, true},
    {"not_finite", &WheelCounts::not_finite, true},
    {"bad_stamps", &WheelCounts::bad_stamps, true},
    {"gaps", &WheelCounts::gaps, true},
    {"overruns", &WheelCounts::overruns, true},
    {"disconnected", &WheelCounts::disconnected, true},
    {"retries", &WheelCounts::retries},
});

/// How long it takes from one frame to the next, and when one is missing.
class GapWatch {
 public:
  /// True for a frame that comes after a gap.
  bool is_after_gap(HostStamp stamp) noexcept;
  void forget() noexcept { *this = {}; }

 private:
  HostStamp last_;
  double usual_s_ = 0;
  int seen_ = 0;
};

/// The speed is what the configured signal of the configured identifier says; its stamp is the frame's arrival less
/// the configured delay. A sample has no yaw rate: not a number. One thread calls open(), read() and close(); counts
/// are for any thread. After open() there is no heap call, also while a lost interface is reopened.
class CanWheelSource final : public WheelSource {
 public:
  explicit CanWheelSource(WheelConfig config);
  ~CanWheelSource() override { close(); }

  Status open() override;
  void close() noexcept override;
  ReadOutcome read(WheelSample& sample, Span timeout) noexcept override;

  WheelCounts counts() const noexcept { return shown_counts_.read(); }
  /// What one frame says, as the kernel hands it out (struct can_frame or canfd_frame); false: nothing. read() is this
  /// with a socket.
  bool decode(std::span<const std::uint8_t> frame, const ArrivalStamps& stamps, WheelSample& sample) noexcept;
  /// Of the interface's own clock, if it has one. The reading thread's.
  ClockState hardware_clock() const noexcept { return clock_.hardware_state(); }

 private:
  Status check_settings() const;
  DeviceTrouble open_socket() noexcept;
  bool reopen(std::int64_t until_ns) noexcept;
  void lose(int error) noexcept;
  bool wait(std::int64_t until_ns) noexcept;
  ReadOutcome read_until(std::int64_t until_ns, WheelSample& sample) noexcept;
  /// kTimeout: nothing waits, or what waited is of no use.
  ReadOutcome take(WheelSample& sample) noexcept;
  bool take_signal(std::span<const std::uint8_t> frame, const ArrivalStamps& stamps, WheelSample& sample) noexcept;

  WheelConfig config_;
  can::CanSocket socket_;
  ArrivalClock clock_;
  GapWatch gap_watch_;
  bool opened_ = false;
  Backoff retry_{Span::from_milliseconds(50), Span::from_milliseconds(1'000)};
  std::uint32_t overruns_seen_ = 0;

  WheelCounts counts_;
  Snapshot<WheelCounts> shown_counts_;
};

}  // namespace epiline
