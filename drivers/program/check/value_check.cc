#include "drivers/program/check/value_check.h"

#include <fmt/format.h>

namespace epiline {

namespace {

constexpr double kFastest_m_s = 60;  // of anything that this is for
constexpr double kSlowest_hz = 4;    // the estimator interpolates heights over half a second at most

struct HeightSensor {
  const char *name, *key;
};
constexpr HeightSensor kHeightSensors[kHeightKinds] = {{"barometer", "barometer"}, {"range finder", "range"}};

}  // namespace

Findings findings_of_wheels(const ValueResults& results) {
  const auto& [pacing, least_m_s, most_m_s] = results[0];
  Findings out;
  const DeviceFindings say("wheel", out);
  if (pacing.samples == 0) {
    say.error("no speed received",
              "see below whether its frame arrives; compare start bit, length and byte order in wheel.signal");
    return out;
  }
  say_silence(pacing, say);
  say.judge(fmt::format("{:.1f} speeds per second, jitter {:.1f} ms, from {:.2f} to {:.2f} m/s", pacing.rate_hz(),
                        1e3 * pacing.jitter_s, least_m_s, most_m_s),
            {{std::max(-least_m_s, most_m_s) > kFastest_m_s, Grade::kWarning,
              "faster than any vehicle: correct scale, sign, start bit or byte order in wheel.signal"}});
  return out;
}

Findings findings_of_heights(const ValueResults& results, const std::array<bool, kHeightKinds>& wanted) {
  Findings out;
  const DeviceFindings say("height", out);
  for (std::size_t i = 0; i < kHeightKinds; ++i) {
    const auto& [pacing, least_m, most_m] = results[i];
    const auto& [name, key] = kHeightSensors[i];
    if (!wanted[i]) continue;
    if (pacing.samples == 0)
      say.warn(fmt::format("no height of a {}", name),
               fmt::format("let its source send it (docs/height.md), or set height.{} = false", key));
    else
      say.judge(fmt::format("{}: {:.1f} heights per second, jitter {:.1f} ms, from {:.2f} to {:.2f} m", name,
                            pacing.rate_hz(), 1e3 * pacing.jitter_s, least_m, most_m),
                {{pacing.rate_hz() < kSlowest_hz, Grade::kWarning,
                  "at least 4 a second: raise the flight controller's stream rate"}});
    say_silence(pacing, say);
  }
  return out;
}

}  // namespace epiline
