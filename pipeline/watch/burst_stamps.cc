#include "pipeline/watch/burst_stamps.h"

namespace epiline {

namespace {
// Of the mean interval: in bursts nearly all intervals are short and the others long; in a stream that jitters, few
// are.
constexpr double kShort = 0.5, kLong = 1.5;
constexpr double kShortShare = 0.4;                      // of the intervals; pairs have a half
constexpr Span kSilence = Span::from_milliseconds(250);  // nobody knows how many readings are missing

/// A reading that is missing makes all that follow one period late. The fastest of each second or two are on the line:
/// the period is known to a per cent or two, and changes with the temperature.
OneWaySettings settings(Span period) {
  OneWaySettings s;
  s.envelope = {Span::from_milliseconds(2'000), Span::from_milliseconds(300), 0.03};
  s.early = kSilence;
  s.late = Span{3 * period.ns / 4};
  s.late_for = kSilence;
  return s;
}
}  // namespace

HostStamp BurstStamps::step(HostStamp stamp) noexcept {
  const Span step = stamp - last_;
  last_ = stamp;
  if (step.ns < 0 || step > kSilence) {
    clock_.reset();
    learnt_count_ = 0;
  }
  if (!clock_) {
    learn(stamp);
    return last_given_ = stamp;
  }
  count(stamp);
  const HostStamp even = clock_->translate(counted_);
  // where straightening begins, and where the line moves, time must not go back
  return last_given_ = even > last_given_ ? even : stamp;
}

void BurstStamps::count(HostStamp stamp) noexcept {
  counted_ = counted_ + period_;
  clock_->update(counted_, stamp);
}

void BurstStamps::learn(HostStamp stamp) noexcept {
  learnt_[static_cast<std::size_t>(learnt_count_++)] = stamp;
  if (learnt_count_ < kLearn) return;
  learnt_count_ = 0;
  recognise();
}

void BurstStamps::recognise() noexcept {
  const double mean_ns = static_cast<double>((learnt_.back() - learnt_.front()).ns) / (kLearn - 1);
  int shorts = 0, bursts = 0;
  std::size_t first = 0, last = 0;  // ends of bursts
  for (std::size_t i = 0; i + 1 < kLearn; ++i) {
    const auto interval_ns = static_cast<double>((learnt_[i + 1] - learnt_[i]).ns);
    if (interval_ns < kShort * mean_ns) ++shorts;
    if (interval_ns <= kLong * mean_ns) continue;
    if (bursts++ == 0) first = i;
    last = i;
  }
  if (shorts < kShortShare * (kLearn - 1) || bursts < 2) return;
  const auto readings = static_cast<std::int64_t>(last - first);
  per_burst_ = static_cast<double>(readings) / (bursts - 1);
  period_ = Span{(learnt_[last] - learnt_[first]).ns / readings};
  clock_.emplace(settings(period_));
  counted_ = {};
  for (const HostStamp stamp : learnt_) count(stamp);
}

}  // namespace epiline
