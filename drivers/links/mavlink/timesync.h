#pragma once
// TIMESYNC both ways: their questions answered, ours asked.
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

/// A clock is learnt only from answers to questions that were asked, each answered once and lately: what is replayed or
/// made up moves nothing. Questions beyond what any flight controller asks are left unanswered, so they take neither
/// the line nor the processor from odometry. Times are monotonic_ns().
class TimesyncExchange {
 public:
  explicit TimesyncExchange(Address own) noexcept : own_(own) {}

  /// Any TIMESYNC that came; `is_autopilot`: from who is worth asking.
  void receive(const Timesync& message, Address from, bool is_autopilot, std::int64_t now_ns) noexcept;

  /// The answer to send now, if one is owed.
  std::optional<Timesync> answer(std::int64_t now_ns) noexcept;
  bool owes_answer() const noexcept { return !owed_.empty(); }
  /// A question that is sent now.
  Timesync question(Address to, std::int64_t now_ns) noexcept;

  const TwoWaySync& clock() const noexcept { return clock_; }
  /// Questions not answered, being too many; answers to nothing we asked.
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
