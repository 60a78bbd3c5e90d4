#pragma once
// What of our odometry a flight controller may see, and what it is told of the rest.
#include <cstdint>
#include <optional>

#include "platform/samples/samples.h"

namespace epiline::mavlink {

/// How we are, as far as the other side cares.
enum class Condition : std::uint8_t {
  kWaiting,  ///< no estimate yet
  kGood,
  kDegraded,
  kLost,
  kSilent,  ///< nobody hands out estimates any more
};
Condition condition_of(const Health& health) noexcept;
/// MAV_STATE for the heartbeat: standby, active or critical.
std::uint8_t system_state_of(Condition condition) noexcept;

/// PX4 fuses whatever comes, also of quality -1, and ArduPilot likewise unless told otherwise: so an estimate that is
/// lost is not sent at all. Nor is one whose stamp is not later than those before: a pose is never repeated. The reset
/// counter of the messages is our own: it goes on by one when the estimate has jumped, and also when sending resumes
/// after it had to stop, for what drifted in the meantime is a jump for who did not see it.
class OdometryGate {
 public:
  /// `first_counter` should differ from run to run: the receiver of a restarted program must see a jump.
  explicit OdometryGate(std::uint8_t first_counter) noexcept : counter_(first_counter) {}

  /// Whether it may be sent; to be asked for each in turn. Those admitted may be left out.
  bool admits(const epiline::Odometry& odometry) noexcept;
  /// Sending stops, for there is nothing any more that could be asked for.
  void stop() noexcept { has_stopped_ = estimator_counter_.has_value(); }
  /// Goes with what was admitted last.
  std::uint8_t reset_counter() const noexcept { return counter_; }

 private:
  std::uint8_t counter_;
  std::optional<std::uint32_t> estimator_counter_;  ///< of what was admitted last
  bool has_stopped_ = false;
  std::int64_t newest_us_ = 0;
};

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
