#pragma once
// The flight controller's IMU: converts its messages to IMU samples.
#include <array>
#include <cstdint>

#include "drivers/links/mavlink/message.h"
#include "platform/ports/counter.h"
#include "platform/samples/samples.h"
#include "platform/time/clock.h"
#include "platform/time/interval_tracker.h"
#include "platform/time/two_way_sync.h"

namespace epiline::mavlink {

struct ControllerImuCounts {
  std::uint64_t readings = 0;        ///< delivered
  std::uint64_t lost = 0;            ///< missing, by the gaps between the others
  std::uint64_t duplicates = 0;      ///< samples with a repeated or earlier time
  std::uint64_t refused_values = 0;  ///< values that no IMU gives, or without both sensors
  std::uint64_t refused_times = 0;   ///< times that do not fit the clock model, or intervals shorter than any sensor's
  std::uint64_t no_clock = 0;        ///< before the clock model was ready
  std::uint64_t others = 0;          ///< of another sensor, or in a less precise message than another that arrives
  std::uint64_t overrun = 0;         ///< lost because the reader was too slow
};
inline constexpr auto kControllerImuCounters = std::to_array<Counter<ControllerImuCounts>>({
    {"readings", &ControllerImuCounts::readings},
    {"lost", &ControllerImuCounts::lost, true},
    {"duplicates", &ControllerImuCounts::duplicates, true},
    {"refused_values", &ControllerImuCounts::refused_values, true},
    {"refused_times", &ControllerImuCounts::refused_times, true},
    {"no_clock", &ControllerImuCounts::no_clock},
    {"others", &ControllerImuCounts::others},
    {"overrun", &ControllerImuCounts::overrun, true},
});

/// Checks everything that it receives: values have bounds, and times must fit the clock model, which uses only answers
/// to this link's own requests.
class ControllerImu {
 public:
  /// `delay`: from sampling to the time in the message.
  explicit ControllerImu(Span delay) noexcept : delay_(delay) {}

  /// True: `sample` is a reading, stamps in a row rise. HIGHRES_IMU is preferred: while it comes, others are left out.
  bool take(const HighresImu& message, const TwoWaySync& clock, HostStamp now, ImuSample& sample) noexcept;
  /// `message` in ArduPilot's units; those of other flight controllers are unknown.
  bool take(const RawImu& message, const TwoWaySync& clock, HostStamp now, ImuSample& sample) noexcept;

  const ControllerImuCounts& counts() const noexcept { return counts_; }
  void count_overrun() noexcept { ++counts_.overrun; }

 private:
  bool is_preferred(bool is_highres, std::uint8_t id, HostStamp now) noexcept;
  bool accept(std::uint64_t time_us, const TwoWaySync& clock, HostStamp now, ImuSample& sample) noexcept;

  Span delay_;
  ControllerImuCounts counts_;
  IntervalTracker interval_;
  std::uint64_t last_time_us_ = 0;
  HostStamp last_stamp_;
  bool is_highres_ = false;  ///< what the sensor in use comes in
  std::uint8_t id_ = 0;
  HostStamp last_of_sensor_;
};

}  // namespace epiline::mavlink
