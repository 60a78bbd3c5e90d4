#pragma once
// Checks the wheel speeds of a vehicle.
#include <cstdint>
#include <mutex>

#include "drivers/program/check/finding.h"
#include "drivers/program/check/pacing.h"
#include "drivers/program/check/watcher.h"
#include "platform/ports/ports.h"

namespace epiline {

struct WheelResult {
  PacingResult pacing;
  double least_m_s = 0, most_m_s = 0;  ///< speeds
};

/// Reads wheel speeds in a thread of its own, from construction on.
class WheelCheck {
 public:
  /// `wheel` must be open and outlive this object.
  explicit WheelCheck(WheelSource& wheel) : wheel_(wheel), thread_([this] { return look(); }) {}
  WheelResult so_far();

 private:
  bool look();

  WheelSource& wheel_;
  std::mutex mutex_;
  Pacing pacing_;
  double least_m_s_ = 0, most_m_s_ = 0;
  Watcher thread_;  // last: it uses the others
};

Findings findings_of(const WheelResult& result);

}  // namespace epiline
