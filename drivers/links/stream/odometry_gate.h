#pragma once
// Decides which odometry a receiver may get.
#include <cstdint>
#include <optional>

#include "platform/samples/samples.h"

namespace epiline {

/// State of the estimate, for a receiver of odometry.
enum class Condition : std::uint8_t {
  kWaiting,  ///< no estimate yet
  kGood,
  kDegraded,
  kLost,
  kSilent,   ///< the estimator no longer publishes estimates
  kRefused,  ///< of the receiver, not of the estimate: it cannot use what would be sent
};
Condition condition_of(const Health& health) noexcept;

/// PX4 and, by default, ArduPilot fuse whatever arrives, even with quality -1. A lost estimate is therefore not sent,
/// nor one whose timestamp is not later than the previous ones. The gate has a reset counter of its own: it increases
/// by one when the estimate jumps, and when sending resumes after a stop, because the drift in between is a jump for
/// the receiver.
class OdometryGate {
 public:
  /// `first_counter` should differ from run to run, so that a restart of the program is a jump for the receiver.
  explicit OdometryGate(std::uint8_t first_counter) noexcept : counter_(first_counter) {}

  /// True if this odometry may be sent. Call it for each one in order; admitted ones need not be sent.
  bool admits(const Odometry& odometry) noexcept;
  /// The estimator no longer publishes: sending stops.
  void stop() noexcept { has_stopped_ = estimator_counter_.has_value(); }
  /// Reset counter of the last admitted odometry.
  std::uint8_t reset_counter() const noexcept { return counter_; }

 private:
  std::uint8_t counter_;
  std::optional<std::uint32_t> estimator_counter_;  ///< of what was admitted last
  bool has_stopped_ = false;
  std::int64_t newest_us_ = 0;
};

}  // namespace epiline
