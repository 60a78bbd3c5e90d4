#pragma once
// What the flight controller and the pilot learn about the estimate besides odometry.
#include <cstdint>
#include <optional>

#include "drivers/links/stream/odometry_gate.h"

namespace epiline::mavlink {

/// MAV_STATE for the heartbeat: standby, active or critical.
std::uint8_t system_state_of(Condition condition) noexcept;

/// One of MAVLink's texts for a pilot.
struct PilotText {
  std::uint8_t severity = 6;  ///< MAV_SEVERITY
  char text[51] = {};         ///< 50 characters, and a zero
};

/// Tells each change once, when it has lasted, and no more than one a second. What ends the odometry is told at once.
class PilotNews {
 public:
  void update(std::int64_t now_ns, Condition condition, std::uint32_t reasons) noexcept;
  /// When update() has something to tell, if nothing changes; far away if never.
  std::int64_t due_ns() const noexcept;
  /// What to tell now.
  std::optional<PilotText> take(std::int64_t now_ns) noexcept;

 private:
  Condition now_ = Condition::kWaiting;
  std::optional<Condition> told_;
  bool was_lost_ = false;  ///< told so, and nothing else since
  std::uint32_t reasons_ = 0;
  std::int64_t since_ns_ = 0, last_told_ns_ = -(std::int64_t{1} << 60);
};

/// In words; `resumed`: odometry had been stopped before.
PilotText pilot_text(Condition condition, std::uint32_t reasons, bool resumed) noexcept;

}  // namespace epiline::mavlink
