#include "drivers/program/hil/timesync_filter.h"

#include <cmath>

namespace epiline::hil {

namespace {
constexpr double kDeviationMost_ns = 100e6;
constexpr int kDeviationsMost = 5;
constexpr double kGainFirst = 0.05, kGainLast = 0.003;
}  // namespace

TimesyncFilter::Outcome TimesyncFilter::update(std::int64_t sent_ns, std::int64_t other_ns, std::int64_t received_ns) {
  if (received_ns - sent_ns > kRoundTripMost_ns) return Outcome::kSlow;
  // no sum of stamps: a peer may send any number
  const double offset_ns =
      static_cast<double>(sent_ns) - static_cast<double>(other_ns) + 0.5 * static_cast<double>(received_ns - sent_ns);
  if (converged() && std::abs(offset_ns - offset_ns_) > kDeviationMost_ns) {
    if (++deviations_ <= kDeviationsMost) return Outcome::kDeviates;
    *this = {};
    return Outcome::kReset;
  }
  deviations_ = 0;
  smooth(offset_ns);
  return Outcome::kUsed;
}

/// Double exponential smoothing, its gain falling from the first value to the last while the filter converges.
void TimesyncFilter::smooth(double offset_ns) {
  if (count_++ == 0) {
    offset_ns_ = offset_ns;
    return;
  }
  const double progress = static_cast<double>(count_) / kConvergence;
  const double late = progress < 1 ? 1 - std::exp(0.5 * (1 - 1 / (1 - progress))) : 1;
  const double gain = late * kGainLast + (1 - late) * kGainFirst;
  const double before_ns = offset_ns_;
  offset_ns_ = gain * offset_ns + (1 - gain) * (offset_ns_ + drift_ns_);
  drift_ns_ = gain * (offset_ns_ - before_ns) + (1 - gain) * drift_ns_;
}

}  // namespace epiline::hil
