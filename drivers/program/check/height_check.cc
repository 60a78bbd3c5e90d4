#include "drivers/program/check/height_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>

#include "platform/time/monotonic.h"

namespace epiline {

namespace {

constexpr Span kHeightWait = Span::from_milliseconds(100);
constexpr double kSlowest_hz = 4;  // the estimator interpolates over half a second at most
constexpr std::array kSensors{"barometer", "range finder"};

Finding finding_of(const HeightResult::Sensor& s, const char* sensor) {
  if (s.pacing.samples == 0)
    return {Grade::kWarning, "height", fmt::format("no height of a {}", sensor),
            fmt::format("let its source send it (docs/height.md), or set height.{} = false",
                        sensor == kSensors[0] ? "barometer" : "range")};
  std::string text = fmt::format("{}: {:.1f} heights per second, jitter {:.1f} ms, from {:.2f} to {:.2f} m", sensor,
                                 s.pacing.rate_hz(), 1e3 * s.pacing.jitter_s, s.least_m, s.most_m);
  if (s.pacing.rate_hz() < kSlowest_hz)
    return {Grade::kWarning, "height", std::move(text),
            "at least 4 a second: raise the flight controller's stream rate"};
  return {Grade::kOk, "height", std::move(text), {}};
}

}  // namespace

bool HeightCheck::look() {
  HeightSample sample;
  const ReadOutcome outcome = source_.read(sample, kHeightWait);
  if (outcome == ReadOutcome::kFailed) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  if (outcome != ReadOutcome::kSample) return outcome != ReadOutcome::kEnd;
  const std::lock_guard lock(mutex_);
  const auto i = static_cast<std::size_t>(sample.kind);
  HeightResult::Sensor& s = heard_.sensors[i];
  const bool is_first = pacing_[i].samples() == 0;
  s.least_m = is_first ? sample.metres : std::min(s.least_m, sample.metres);
  s.most_m = is_first ? sample.metres : std::max(s.most_m, sample.metres);
  pacing_[i].step(sample.stamp, {monotonic_ns()});
  return true;
}

HeightResult HeightCheck::so_far() {
  const std::lock_guard lock(mutex_);
  HeightResult result = heard_;
  for (std::size_t i = 0; i < kHeightKinds; ++i) result.sensors[i].pacing = pacing_[i].result({monotonic_ns()});
  return result;
}

Findings findings_of(const HeightResult& result, const std::array<bool, kHeightKinds>& wanted) {
  Findings out;
  for (std::size_t i = 0; i < kHeightKinds; ++i)
    if (wanted[i]) {
      out.push_back(finding_of(result.sensors[i], kSensors[i]));
      say_silence(result.sensors[i].pacing, "height", out);
    }
  return out;
}

}  // namespace epiline
