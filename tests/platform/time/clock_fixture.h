#pragma once
// A device clock that is known, the delays of its samples, and what theory says of any line below them.
#include <rapidcheck.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

#include "platform/time/clock.h"

namespace epiline {

/// host = device + offset + skew device.
struct TrueClock {
  std::int64_t offset_ns = 0;
  double skew = 0;
  HostStamp host_of(DeviceStamp device) const {
    return {device.ns + offset_ns + std::llround(skew * static_cast<double>(device.ns))};
  }
};

struct Arrival {
  DeviceStamp device;
  HostStamp host;             ///< of the sample itself, by the true clock
  std::int64_t delay_ns = 0;  ///< beyond the least one
  HostStamp arrival() const { return {host.ns + delay_ns}; }
};

/// Samples at about `rate_hz` whose delays are exponential, and now and then a stall after which all come at once.
struct Traffic {
  double rate_hz = 200, delay_mean_ns = 3e5, stalls_per_s = 0.2, stall_most_ns = 2e8;

  std::vector<Arrival> make(const TrueClock& clock, std::int64_t begin_ns, std::int64_t end_ns,
                            std::mt19937& random) const {
    std::exponential_distribution<double> delay(1 / delay_mean_ns);
    std::uniform_real_distribution<double> uniform(0, 1);
    std::vector<Arrival> samples;
    std::int64_t stalled_until_ns = -4'000'000'000'000'000'000;  // before any host time
    for (double t = static_cast<double>(begin_ns); t < static_cast<double>(end_ns);
         t += (0.9 + 0.2 * uniform(random)) * 1e9 / rate_hz) {
      Arrival a;
      a.device = {static_cast<std::int64_t>(t)};
      a.host = clock.host_of(a.device);
      a.delay_ns = static_cast<std::int64_t>(delay(random));
      if (uniform(random) < stalls_per_s / rate_hz)
        stalled_until_ns = a.host.ns + static_cast<std::int64_t>(stall_most_ns * uniform(random));
      a.delay_ns = std::max(a.delay_ns, stalled_until_ns - a.host.ns);
      samples.push_back(a);
    }
    return samples;
  }
};

/// The theorem of docs/derivations/clock_sync.md: how far a highest line below samples with delays d_i can be from the
/// truth at the newest one.
struct ErrorBounds {
  double least_ns = -std::numeric_limits<double>::infinity(), most_ns = std::numeric_limits<double>::infinity();

  static ErrorBounds of(const std::vector<Arrival>& samples) {
    double mean = 0;
    for (const Arrival& a : samples) mean += static_cast<double>((a.device - samples[0].device).ns);
    mean /= static_cast<double>(samples.size());
    const double newest = static_cast<double>((samples.back().device - samples[0].device).ns);
    ErrorBounds bounds;
    for (const Arrival& a : samples) {
      const double x = static_cast<double>((a.device - samples[0].device).ns), d = static_cast<double>(a.delay_ns);
      if (x < mean) bounds.least_ns = std::max(bounds.least_ns, -d * (newest - mean) / (mean - x));
      if (x > mean) bounds.most_ns = std::min(bounds.most_ns, d * (newest - mean) / (x - mean));
    }
    return bounds;
  }
  bool hold(double error_ns) const { return error_ns >= least_ns - 3 && error_ns <= most_ns + 3; }  // rounding to ns
};

inline TrueClock any_clock(int skew_most_ppm = 200) {
  return {*rc::gen::inRange<std::int64_t>(-1'000'000'000'000'000'000, 1'000'000'000'000'000'000),
          *rc::gen::inRange(-1000 * skew_most_ppm, 1000 * skew_most_ppm + 1) * 1e-9};
}

inline std::mt19937 any_random() { return std::mt19937(*rc::gen::arbitrary<unsigned>()); }

}  // namespace epiline
