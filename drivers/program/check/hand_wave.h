#pragma once
// The hand motion of `epiline check`: camera and gyroscope by the same watch that flies
// (estimator/monitor/turn_watch.h).
#include <mutex>
#include <vector>

#include "drivers/program/check/finding.h"
#include "estimator/monitor/turn_watch.h"

namespace epiline {

/// Images by one thread, readings by another.
class HandWave {
 public:
  /// What was seen `fades_s` ago counts for less.
  explicit HandWave(double time_offset_s, double fades_s = kNothingFades_s) : watch_(time_offset_s, fades_s) {}

  void add_images(const TrackedFrame& tracked);
  void add_reading(const ImuSample& reading);
  /// Not while images are added.
  TurnAgreement agreement() const { return watch_.agreement(); }

 private:
  static constexpr double kNothingFades_s = 1e9;
  std::mutex mutex_;
  std::vector<ImuSample> readings_;  ///< not yet taken by the images' thread
  TurnWatch watch_;
};

/// `R_BC`, `time_offset_s`: configured.
Findings findings_of(const TurnAgreement& agreement, const Mat3& R_BC, double time_offset_s);

}  // namespace epiline
