#pragma once
// TIMESYNC in both directions: answers requests, and sends its own.
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "drivers/links/mavlink/message.h"
#include "drivers/links/mavlink/packet.h"
#include "drivers/links/stream/token_bucket.h"
#include "platform/memory/fixed_vector.h"
#include "platform/time/two_way_sync.h"

namespace epiline::mavlink {

/// The clock model uses only recent answers to this link's own requests, each once, so replayed or forged messages have
/// no effect. Requests beyond a sensible rate are not answered, so they cannot displace odometry. Times are
/// monotonic_ns().
class TimesyncExchange {
 public:
  explicit TimesyncExchange(Address own) noexcept : own_(own) {}

  /// A received TIMESYNC message; `is_autopilot`: its sender is the flight controller.
  void receive(const Timesync& message, Address from, bool is_autopilot, std::int64_t now_ns) noexcept;

  /// The answer to send now, if any.
  std::optional<Timesync> answer(std::int64_t now_ns) noexcept;
  bool owes_answer() const noexcept { return !owed_.empty(); }
  /// The request to send now.
  Timesync question(Address to, std::int64_t now_ns) noexcept;

  const TwoWaySync& clock() const noexcept { return clock_; }
  /// Requests that were too many to answer; answers to no request.
  std::uint64_t refused_questions() const noexcept { return refused_questions_; }
  std::uint64_t refused_answers() const noexcept { return refused_answers_; }

 private:
  static constexpr std::size_t kOpen = 4, kOwed = 4;
  static constexpr double kAnswersPerSecond = 100, kAnswersAtOnce = 10;  // PX4 and ArduPilot ask ten times or less

  struct Owed {
    std::int64_t ts1 = 0;
    Address to;
  };

  Address own_;
  TwoWaySync clock_{TwoWaySettings{}};
  std::array<std::int64_t, kOpen> open_{};  ///< questions not answered yet, by the time they were sent; 0: none
  std::size_t next_ = 0;
  FixedVector<Owed, kOwed> owed_;
  TokenBucket answers_{kAnswersPerSecond, kAnswersAtOnce};
  std::uint64_t refused_questions_ = 0, refused_answers_ = 0;
};

}  // namespace epiline::mavlink
