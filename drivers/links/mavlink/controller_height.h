#pragma once
// The flight controller's barometer and range finder: converts its messages to heights.
#include <array>
#include <cstdint>
#include <optional>

#include "drivers/links/mavlink/message.h"
#include "drivers/links/mavlink/packet.h"
#include "platform/ports/counter.h"
#include "platform/samples/samples.h"
#include "platform/time/clock.h"
#include "platform/time/two_way_sync.h"

namespace epiline::mavlink {

struct ControllerHeightCounts {
  std::uint64_t heights = 0;         ///< of the barometer, delivered
  std::uint64_t distances = 0;       ///< of the range finder, delivered
  std::uint64_t refused_values = 0;  ///< values that no sensor gives, or that the sensor itself calls invalid
  std::uint64_t refused_times = 0;   ///< times that do not fit the clock model, repeated or earlier ones
  std::uint64_t no_clock = 0;        ///< before the clock model was ready
  std::uint64_t others = 0;          ///< of another sensor than the one in use, or a beam that does not look down
  std::uint64_t overrun = 0;         ///< lost because the reader was too slow
};
inline constexpr auto kControllerHeightCounters = std::to_array<Counter<ControllerHeightCounts>>({
    {"heights", &ControllerHeightCounts::heights},
    {"distances", &ControllerHeightCounts::distances},
    {"refused_values", &ControllerHeightCounts::refused_values, true},
    {"refused_times", &ControllerHeightCounts::refused_times, true},
    {"no_clock", &ControllerHeightCounts::no_clock},
    {"others", &ControllerHeightCounts::others},
    {"overrun", &ControllerHeightCounts::overrun, true},
});

/// Checks everything that it receives, as ControllerImu does. Of several barometers, and of several range finders, the
/// first that came is kept as long as it comes.
class ControllerHeight {
 public:
  explicit ControllerHeight(double air_deg) noexcept : air_deg_(air_deg) {}

  /// True: the packet was a height's, and `sample` is a good one. Stamps of each kind rise.
  bool take(const Packet& packet, const TwoWaySync& clock, HostStamp now, HeightSample& sample) noexcept;
  /// Whether the packet is one of a height sensor.
  static bool is_mine(const Packet& packet) noexcept;

  const ControllerHeightCounts& counts() const noexcept { return counts_; }
  void count_overrun() noexcept { ++counts_.overrun; }
  /// When a sample of the kind came last; zero: never.
  HostStamp last_of(HeightKind kind) const noexcept { return sensors_[static_cast<std::size_t>(kind)].last_arrival; }

 private:
  struct Reading {
    HeightKind kind = HeightKind::kBarometer;
    std::uint32_t sensor = 0;  ///< message and id
    std::int64_t device_ns = 0;
    double metres = 0;  ///< not a number: refused
  };
  struct Sensor {
    std::uint32_t sensor = 0;
    HostStamp last_arrival, last_stamp;
  };
  std::optional<Reading> reading_of(const Packet& packet) const noexcept;

  double air_deg_;
  std::array<Sensor, kHeightKinds> sensors_;
  ControllerHeightCounts counts_;
};

/// Requests the messages of the height sensors from a flight controller that does not send them. Times are
/// monotonic_ns().
class HeightRequest {
 public:
  /// `wanted`: which kinds.
  explicit HeightRequest(const std::array<bool, kHeightKinds>& wanted) noexcept : wanted_(wanted) {}

  /// When to call question() again.
  std::int64_t due_ns() const noexcept { return looked_ns_ + kAgain_ns; }
  /// For the next of the messages whose kind is wanted and does not come; none if all come.
  std::optional<CommandLong> question(const ControllerHeight& heights, Address to, std::int64_t now_ns) noexcept;

 private:
  static constexpr std::int64_t kAgain_ns = 2'000'000'000;

  std::array<bool, kHeightKinds> wanted_;
  std::int64_t looked_ns_ = 0;
  std::size_t next_ = 0;
};

}  // namespace epiline::mavlink
