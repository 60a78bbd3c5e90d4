#include "pipeline/watch/stamp_gate.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace epiline {

namespace {
constexpr int kLearn = 20;                            // stamps until the usual lead is known
constexpr Span kAhead = Span::from_milliseconds(30);  // more than that before its usual time: the clock stepped
constexpr Span kAgree = Span::from_milliseconds(20);  // two suspects that tell the same story
constexpr Span kSame = Span::from_milliseconds(5);    // a step back to that close to none: none
constexpr double kLeak = 500e-6;                      // s/s; a clock that loses time must not look early later
constexpr Span kWindow = Span::from_milliseconds(2'000);
constexpr int kWindowsForDrift = 4;
}  // namespace

/// How far the stamp should advance: what the computer's clock did, in whole periods where that fits.
Span StampGate::expected_step(Span since) const noexcept {
  if (period_.ns <= 0) return since;
  const double periods = since.seconds() / period_.seconds(), whole = std::round(periods);
  if (whole < 1 || std::abs(periods - whole) > 0.25 || whole > 100) return since;
  return {static_cast<std::int64_t>(whole) * period_.ns};
}

/// The clock's rate by the largest leads: delays only make them smaller.
void StampGate::follow_drift(HostStamp arrival, Span lead) noexcept {
  if (windows_ == 0) {
    window_begin_ = arrival;
    window_lead_ = lead;
    windows_ = 1;
  }
  window_lead_ = std::max(window_lead_, lead);
  if (arrival - window_begin_ < kWindow) return;
  if (windows_ == 1) {
    first_at_ = arrival;
    first_lead_ = window_lead_;
  } else if (windows_ > kWindowsForDrift) {
    drift_ = (window_lead_ - first_lead_).seconds() / (arrival - first_at_).seconds();
  }
  ++windows_;
  window_begin_ = arrival;
  window_lead_ = lead;
}

StampGate::Verdict StampGate::use(HostStamp stamp, HostStamp arrival) noexcept {
  const HostStamp corrected = stamp + correction_;
  if (any_) {
    const Span step = corrected - last_;
    period_ = period_.ns == 0 ? step : Span{period_.ns + (std::min(step.ns, 2 * period_.ns) - period_.ns) / 16};
  }
  if (arrival.ns != 0) {
    const Span lead = corrected - arrival;
    const Span leak = any_ ? Span::from_seconds(kLeak * (arrival - last_arrival_).seconds()) : Span{};
    reference_ = any_ ? std::max(lead, reference_ - leak) : lead;
    follow_drift(arrival, lead);
  }
  learnt_ = std::min(learnt_ + 1, kLearn);
  any_ = true;
  suspicious_ = false;
  last_ = corrected;
  last_arrival_ = arrival;
  return Verdict::kUse;
}

StampGate::Verdict StampGate::adopt(Span jump, HostStamp stamp, HostStamp arrival) noexcept {
  correction_ = correction_ - jump;
  if (std::abs(correction_.ns) < kSame.ns) correction_ = {};
  if (stamp + correction_ <= last_) return Verdict::kOld;
  windows_ = 0;  // a measured rate would contain the step
  stepped_ = true;
  stepped_at_ = stamp + correction_;
  return use(stamp, arrival);
}

StampGate::Verdict StampGate::step(HostStamp stamp, HostStamp arrival) noexcept {
  stepped_ = false;
  if (!any_) return use(stamp, arrival);
  const Span advance = stamp + correction_ - last_;
  if (arrival.ns == 0) return advance.ns > 0 ? use(stamp, arrival) : Verdict::kOld;
  // A sensor that goes on at its usual pace has not stepped, however late its driver was before.
  const bool regular = advance.ns > 0 && std::abs(advance.ns - period_.ns) < period_.ns / 4;
  const bool early = !regular && learnt_ == kLearn && stamp + correction_ - arrival > reference_ + kAhead;
  if (!early && advance.ns > 0) return use(stamp, arrival);
  const Span jump = advance - expected_step(arrival - last_arrival_);
  if (!early && std::abs(jump.ns) < kAhead.ns) return Verdict::kOld;  // a neighbour of the last one
  const bool again = suspicious_ && std::abs((jump - suspected_).ns) < kAgree.ns;
  if (again) return adopt(jump, stamp, arrival);
  suspicious_ = true;
  suspected_ = jump;
  return Verdict::kSuspect;
}

}  // namespace epiline
