#include "drivers/program/hil/stream_rules.h"

#include <fmt/format.h>

namespace epiline::hil {

namespace {
constexpr Span kStart = Span::from_milliseconds(200), kPx4Stop = Span::from_milliseconds(400);
constexpr Span kArdupilotStop = Span::from_milliseconds(300), kAnnounced = Span::from_milliseconds(1000);
constexpr double kRateLeast_hz = 30, kRateMost_hz = 50, kTolerance = 0.05;
constexpr std::uint64_t kFlood = 100, kArdupilotLeast = 4;
constexpr std::int64_t kSecond_ns = 1'000'000'000;
}  // namespace

bool StreamRules::take(HostStamp arrival, HostStamp stamp, RuleBook& book) {
  if (newest_arrival_) judge_pause(arrival, book);
  if (newest_arrival_ && arrival - *newest_arrival_ < kStart) started_ = true;
  count_second(arrival, book);
  newest_arrival_ = arrival;
  announced_ = newest_text_ && arrival - *newest_text_ <= kAnnounced;
  if (!newest_stamp_) {
    newest_stamp_ = stamp;
    return true;
  }
  const Span step = stamp - *newest_stamp_;
  const bool rises = book.judge(Rule::kStamps, step.ns > 0, arrival, [&] {
    return fmt::format("time_usec {} after {}", stamp.ns / 1000, newest_stamp_->ns / 1000);
  });
  if (!rises) return false;
  newest_stamp_ = stamp;
  if (step < kStart) streaming_ = streaming_ + step, ++intervals_;
  return true;
}

void StreamRules::take_text(HostStamp arrival) {
  newest_text_ = arrival;
  if (newest_arrival_ && arrival - *newest_arrival_ <= kAnnounced) announced_ = true;
}

void StreamRules::judge_pause(HostStamp until, RuleBook& book) const {
  const Span pause = until - *newest_arrival_;
  const auto judge = [&](Rule rule, Span most) {
    book.judge(rule, pause < most || announced_, until,
               [&] { return fmt::format("{:.0f} ms without odometry", 1e3 * pause.seconds()); });
  };
  judge(Rule::kGapStart, kStart);
  judge(Rule::kGapStop, kPx4Stop);
  judge(Rule::kGapArdupilot, kArdupilotStop);
}

/// Judges the second that has gone by, if it was a whole one without an announced pause.
void StreamRules::count_second(HostStamp arrival, RuleBook& book) {
  if (!first_arrival_) first_arrival_ = arrival;
  if (newest_arrival_ && arrival - *newest_arrival_ >= kStart && announced_) paused_in_second_ = true;
  const std::int64_t second = (arrival - *first_arrival_).ns / kSecond_ns;
  if (second != second_) {
    const auto text = [&] { return fmt::format("{} messages in a second", in_second_); };
    book.judge(Rule::kFlood, in_second_ <= kFlood, arrival, text);
    if (second == second_ + 1 && !paused_in_second_)
      book.judge(Rule::kRateArdupilot, in_second_ >= kArdupilotLeast, arrival, text);
    second_ = second;
    in_second_ = 0;
    paused_in_second_ = false;
  }
  ++in_second_;
}

void StreamRules::finish(HostStamp end, RuleBook& book) {
  book.judge(Rule::kFusion, started_, end, [&] {
    return std::string(newest_arrival_ ? "no two samples less than 200 ms apart" : "no odometry at all");
  });
  if (newest_arrival_) judge_pause(end, book);
  if (streaming_.ns <= 0) return;
  const double rate_hz = static_cast<double>(intervals_) / streaming_.seconds();
  const auto text = [&] { return fmt::format("{:.1f} Hz", rate_hz); };
  book.figure(Rule::kRate, text());
  book.judge(Rule::kRate, rate_hz >= kRateLeast_hz * (1 - kTolerance) && rate_hz <= kRateMost_hz * (1 + kTolerance),
             end, text);
}

}  // namespace epiline::hil
