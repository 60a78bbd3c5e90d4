#pragma once
// What barometer and range finder say.
#include <array>
#include <mutex>

#include "drivers/program/check/finding.h"
#include "drivers/program/check/pacing.h"
#include "drivers/program/check/watcher.h"
#include "platform/ports/ports.h"

namespace epiline {

struct HeightResult {
  struct Sensor {
    PacingResult pacing;
    double least_m = 0, most_m = 0;
  };
  std::array<Sensor, kHeightKinds> sensors;
};

/// Reads heights from construction on, in a thread of its own.
class HeightCheck {
 public:
  /// `source` is open, and outlives this.
  explicit HeightCheck(HeightSource& source) : source_(source), thread_([this] { return look(); }) {}
  HeightResult so_far();

 private:
  bool look();

  HeightSource& source_;
  std::mutex mutex_;
  HeightResult heard_;
  std::array<Pacing, kHeightKinds> pacing_;
  Watcher thread_;
};

/// `wanted`: which kinds the configuration uses.
Findings findings_of(const HeightResult& result, const std::array<bool, kHeightKinds>& wanted);

}  // namespace epiline
