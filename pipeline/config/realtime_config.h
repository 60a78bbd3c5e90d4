#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/config/named_value.h"
#include "platform/linux/realtime.h"

namespace epiline {

/// Threads of a flight that may have a priority.
enum class FlightThread : std::uint8_t { kImu, kCapture, kPublish, kTrack, kEstimate };
inline constexpr std::array kFlightThreadNames = {"imu", "capture", "publish", "track", "estimate"};

/// Section [realtime]: how the threads run.
struct RealtimeConfig {
  double deadline_ms = 50;  ///< from an image's stamp to its odometry; 0: as long as it takes
  double imu_wait_ms = 100;
  int priority = 80;             ///< SCHED_FIFO's, of the most urgent thread; 0: the ordinary scheduler for all
  std::vector<NamedValue> cpus;  ///< processors, by kFlightThreadNames; a thread without one runs anywhere
  bool lock_memory = true;
};

/// Section [recorder]: the flight recorder.
struct RecorderConfig {
  std::string folder;  ///< of the records; empty: no recorder
  double seconds = 30;
  bool images = false;
  int image_memory_mib = 256;
  int keep = 50;  ///< records in the folder: the oldest are removed; 0: all stay
  // Not settings: of the records that it makes by itself when the estimate is lost or reset.
  double after_lost_s = 3;  ///< recording continues for this time before it writes: shows how the loss goes on
  double pause_s = 60;      ///< between two of them, so that a vehicle that stays lost does not fill the disk
  int most = 20;            ///< in a run
};

/// The nearer a thread is to a sensor or receiver, the shorter it runs and the more urgent it is.
inline ThreadSettings settings_of(FlightThread thread, const RealtimeConfig& config,
                                  std::size_t stack_bytes = ThreadSettings{}.stack_bytes) {
  constexpr std::array kBelowFirst = {0, 10, 15, 20, 20};
  const auto i = static_cast<std::size_t>(thread);
  ThreadSettings s{kFlightThreadNames[i], 0, -1, stack_bytes};
  if (config.priority != 0) s.priority = std::max(1, config.priority - kBelowFirst[i]);
  for (const NamedValue& cpu : config.cpus)
    if (cpu.name == s.name) s.cpu = static_cast<int>(cpu.value);
  return s;
}

}  // namespace epiline
