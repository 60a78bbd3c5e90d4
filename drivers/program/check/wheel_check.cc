#include "drivers/program/check/wheel_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>

#include "platform/time/monotonic.h"

namespace epiline {

namespace {

constexpr Span kWheelWait = Span::from_milliseconds(100);
constexpr double kFastest_m_s = 60;  // of anything that this is for

}  // namespace

bool WheelCheck::look() {
  WheelSample sample;
  const ReadOutcome outcome = wheel_.read(sample, kWheelWait);
  if (outcome == ReadOutcome::kFailed) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  if (outcome != ReadOutcome::kSample) return outcome != ReadOutcome::kEnd;
  const std::lock_guard lock(mutex_);
  const bool is_first = pacing_.samples() == 0;
  const double speed = sample.forward_speed_m_s;
  least_m_s_ = is_first ? speed : std::min(least_m_s_, speed);
  most_m_s_ = is_first ? speed : std::max(most_m_s_, speed);
  pacing_.step(sample.stamp, {monotonic_ns()});
  return true;
}

WheelResult WheelCheck::so_far() {
  const std::lock_guard lock(mutex_);
  return {pacing_.result({monotonic_ns()}), least_m_s_, most_m_s_};
}

Findings findings_of(const WheelResult& r) {
  const auto said = [](Grade grade, std::string text, std::string remedy = {}) {
    return Finding{grade, "wheel", std::move(text), std::move(remedy)};
  };
  if (r.pacing.samples == 0)
    return {said(Grade::kError, "no speed received",
                 "see below whether its frame arrives; compare start bit, length and byte order in wheel.signal")};
  const std::string text = fmt::format("{:.1f} speeds per second, jitter {:.1f} ms, from {:.2f} to {:.2f} m/s",
                                       r.pacing.rate_hz(), 1e3 * r.pacing.jitter_s, r.least_m_s, r.most_m_s);
  Findings out;
  say_silence(r.pacing, "wheel", out);
  if (std::max(-r.least_m_s, r.most_m_s) > kFastest_m_s)
    out.push_back(said(Grade::kWarning, text,
                       "faster than any vehicle: correct scale, sign, start bit or byte order in wheel.signal"));
  else
    out.push_back(said(Grade::kOk, text));
  return out;
}

}  // namespace epiline
