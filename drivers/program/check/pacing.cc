#include "drivers/program/check/pacing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "platform/math/statistics.h"

namespace epiline {

void Pacing::step(HostStamp stamp, HostStamp arrival) {
  last_arrival_ = arrival.ns != 0 ? arrival : stamp;
  if (arrival.ns != 0 && delays_.size() < kMost) delays_.push_back((arrival - stamp).seconds());
  if (samples_++ == 0) {
    last_ = stamp;
    return;
  }
  if (stamp <= last_) {
    ++backwards_;
    return;
  }
  if (intervals_.size() < kMost) intervals_.push_back((stamp - last_).seconds());
  last_ = stamp;
}

PacingResult Pacing::result(HostStamp now) const {
  PacingResult r;
  if (now.ns != 0 && samples_ > 0) r.silent_s = std::max(0.0, (now - last_arrival_).seconds());
  r.samples = samples_;
  r.backwards = backwards_;
  if (intervals_.empty()) return r;
  std::vector<double> sorted = intervals_;
  std::sort(sorted.begin(), sorted.end());
  r.period_s = quantile(sorted, 0.5);
  r.longest_s = sorted.back();
  std::vector<double> off;
  for (const double interval : sorted) {
    if (interval > 1.5 * r.period_s) {
      ++r.gaps;
      r.missing += static_cast<std::uint64_t>(std::lround(interval / r.period_s)) - 1;
    } else {
      off.push_back(std::abs(interval - r.period_s));
    }
  }
  std::sort(off.begin(), off.end());
  if (!off.empty()) r.jitter_s = quantile(off, 0.99);
  std::vector<double> delays = delays_;
  std::sort(delays.begin(), delays.end());
  if (!delays.empty()) {
    r.delay_s = quantile(delays, 0.5);
    r.delay_most_s = delays.back();
  }
  return r;
}

void say_silence(const PacingResult& pacing, const DeviceFindings& say) {
  constexpr double kLeast_s = 0.5, kPeriods = 20;
  if (pacing.silent_s > std::max(kLeast_s, kPeriods * pacing.period_s))
    say.error(fmt::format("nothing came for the last {:.1f} s", pacing.silent_s),
              "it delivered before: check its cable and supply, and that its source still runs");
}

}  // namespace epiline
