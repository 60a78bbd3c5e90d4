#pragma once
// The rules on the flow of estimates: order, rate, pauses.
#include <optional>

#include "drivers/program/hil/rules.h"
#include "drivers/program/hil/vision_sample.h"

namespace epiline::hil {

class StreamRules {
 public:
  /// Takes an estimate, finite or not. False: its timestamp does not increase, so the rules on motion must skip it.
  bool take(HostStamp arrival, HostStamp stamp, RuleBook& book);
  /// Takes the arrival of a STATUSTEXT. Within 1 s of the begin of a pause it counts as the pause's announcement.
  void take_text(HostStamp arrival);
  /// Ends the flight. Odometry was expected until `end`.
  void finish(HostStamp end, RuleBook& book);

 private:
  void judge_pause(HostStamp until, RuleBook& book) const;
  void count_second(HostStamp arrival, RuleBook& book);

  std::optional<HostStamp> newest_arrival_, newest_stamp_, newest_text_;
  bool announced_ = false;  ///< a text came around the newest arrival
  bool started_ = false;    ///< two samples less than 200 ms apart
  Span streaming_;          ///< time of stamps without pauses, and what came in it
  std::uint64_t intervals_ = 0;
  std::optional<HostStamp> first_arrival_;
  std::int64_t second_ = 0;  ///< since the first arrival, and what came in it
  std::uint64_t in_second_ = 0;
  bool paused_in_second_ = false;
};

}  // namespace epiline::hil
