#pragma once
// Statistics of the intervals and delays of samples.
#include <cstdint>
#include <vector>

#include "drivers/program/check/finding.h"
#include "platform/time/clock.h"

namespace epiline {

struct PacingResult {
  std::uint64_t samples = 0;
  double period_s = 0;                   ///< median
  double jitter_s = 0;                   ///< 99 % of the intervals, gaps excluded, differ from the median by less
  double longest_s = 0;                  ///< interval
  std::uint64_t gaps = 0;                ///< intervals of more than one and a half periods
  std::uint64_t missing = 0;             ///< samples that are missing in the gaps
  std::uint64_t backwards = 0;           ///< stamps not later than the one before
  double silent_s = 0;                   ///< since the newest sample came; 0: not asked for
  double delay_s = 0, delay_most_s = 0;  ///< from stamp to arrival: median, longest. Negative: stamps lie in the future
  double rate_hz() const { return period_s > 0 ? 1 / period_s : 0; }
};

class Pacing {
 public:
  /// Takes timestamp and arrival of a sample; arrival zero: not known.
  void step(HostStamp stamp, HostStamp arrival);
  /// `now`: of the arrivals' clock; zero: how long it has been silent is not asked for.
  PacingResult result(HostStamp now = {}) const;
  std::uint64_t samples() const { return samples_; }

 private:
  static constexpr std::size_t kMost = 4'000'000;  // an hour at 1 kHz; later ones are only counted
  std::vector<double> intervals_, delays_;
  HostStamp last_, last_arrival_;
  std::uint64_t samples_ = 0, backwards_ = 0;
};

/// An error if a sensor delivered and does so no more: its rate and gaps end with its last sample.
void say_silence(const PacingResult& pacing, const DeviceFindings& say);

}  // namespace epiline
