#pragma once
// Status of the estimate for the flight controller (heartbeat) and the pilot (STATUSTEXT).
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

/// Reports each change once, after it has lasted half a second, at most once a second. The end of the odometry is
/// reported at once.
class PilotNews {
 public:
  void update(std::int64_t now_ns, Condition condition, std::uint32_t reasons) noexcept;
  /// When update() will have a text, if nothing changes; far in the future if never.
  std::int64_t due_ns() const noexcept;
  /// The text to send now, if any.
  std::optional<PilotText> take(std::int64_t now_ns) noexcept;

 private:
  Condition now_ = Condition::kWaiting;
  std::optional<Condition> told_;
  bool was_lost_ = false;  ///< the last text said so
  std::uint32_t reasons_ = 0;
  std::int64_t since_ns_ = 0, last_told_ns_ = -(std::int64_t{1} << 60);
};

/// The text for a state; `resumed`: odometry was stopped before.
PilotText pilot_text(Condition condition, std::uint32_t reasons, bool resumed) noexcept;

}  // namespace epiline::mavlink
