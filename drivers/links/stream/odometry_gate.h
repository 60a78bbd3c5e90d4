#pragma once
// Which odometry a receiver may see.
#include <cstdint>
#include <optional>

#include "platform/samples/samples.h"

namespace epiline {

/// State of the estimate, as far as a receiver of odometry cares.
enum class Condition : std::uint8_t {
  kWaiting,  ///< no estimate yet
  kGood,
  kDegraded,
  kLost,
  kSilent,  ///< nobody hands out estimates any more
};
Condition condition_of(const Health& health) noexcept;

/// PX4 fuses whatever comes, also of quality -1, and ArduPilot likewise unless told otherwise: so an estimate that is
/// lost is not sent at all. Nor is one whose stamp is not later than those before: a pose is never repeated. The reset
/// counter of the messages is our own: it goes on by one when the estimate has jumped, and also when sending resumes
/// after it had to stop, for what drifted in the meantime is a jump for who did not see it.
class OdometryGate {
 public:
  /// `first_counter` should differ from run to run: the receiver of a restarted program must see a jump.
  explicit OdometryGate(std::uint8_t first_counter) noexcept : counter_(first_counter) {}

  /// Whether it may be sent; to be asked for each in turn. Those admitted may be left out.
  bool admits(const Odometry& odometry) noexcept;
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

}  // namespace epiline
