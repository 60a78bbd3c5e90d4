#pragma once
// Checks the sensors that give one number: the wheels' speed, the heights of barometer and range finder.
#include <algorithm>
#include <array>
#include <mutex>
#include <utility>

#include "drivers/program/check/finding.h"
#include "drivers/program/check/pacing.h"
#include "drivers/program/check/watcher.h"
#include "platform/ports/ports.h"
#include "platform/time/monotonic.h"

namespace epiline {

struct ValueResult {
  PacingResult pacing;
  double least = 0, most = 0;  ///< m/s or m
};
/// By HeightKind; of wheels the first.
using ValueResults = std::array<ValueResult, kHeightKinds>;

/// Reads numbers from construction on, in a thread of its own.
template <class Source, class Sample>
class ValueCheck {
 public:
  /// `source` must be open and outlive this object.
  explicit ValueCheck(Source& source) : source_(source), thread_([this] { return look(); }) {}

  ValueResults so_far() {
    const std::lock_guard lock(mutex_);
    for (std::size_t i = 0; i < kHeightKinds; ++i) heard_[i].pacing = pacing_[i].result({monotonic_ns()});
    return heard_;
  }

 private:
  static std::pair<std::size_t, double> value_of(const WheelSample& s) { return {0, s.forward_speed_m_s}; }
  static std::pair<std::size_t, double> value_of(const HeightSample& s) {
    return {static_cast<std::size_t>(s.kind), s.metres};
  }

  bool look() {
    Sample sample;
    const ReadOutcome outcome = source_.read(sample, Span::from_milliseconds(100));
    if (outcome != ReadOutcome::kSample) return Watcher::goes_on(outcome);
    const auto [i, value] = value_of(sample);
    const std::lock_guard lock(mutex_);
    const bool is_first = pacing_[i].samples() == 0;
    heard_[i].least = is_first ? value : std::min(heard_[i].least, value);
    heard_[i].most = is_first ? value : std::max(heard_[i].most, value);
    pacing_[i].step(sample.stamp, {monotonic_ns()});
    return true;
  }

  Source& source_;
  std::mutex mutex_;
  ValueResults heard_;
  std::array<Pacing, kHeightKinds> pacing_;
  Watcher thread_;  // last: it uses the others
};
using WheelCheck = ValueCheck<WheelSource, WheelSample>;
using HeightCheck = ValueCheck<HeightSource, HeightSample>;

Findings findings_of_wheels(const ValueResults& results);
/// `wanted`: which kinds the configuration uses.
Findings findings_of_heights(const ValueResults& results, const std::array<bool, kHeightKinds>& wanted);

}  // namespace epiline
