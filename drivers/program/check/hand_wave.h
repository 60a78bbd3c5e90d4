#pragma once
// The hand motion of `epiline check`: compares camera and gyroscope with the watch that also runs in flight
// (estimator/monitor/turn_watch.h).
#include <mutex>
#include <vector>

#include "drivers/program/check/finding.h"
#include "estimator/monitor/turn_watch.h"

namespace epiline {

/// One thread adds images, another one IMU samples.
class HandWave {
 public:
  /// `fades_s`: time constant with which older motion loses weight.
  explicit HandWave(double time_offset_s, double fades_s = kNothingFades_s) : watch_(time_offset_s, fades_s) {}

  void add_images(const TrackedFrame& tracked);
  void add_reading(const ImuSample& reading);
  /// Do not call while another thread adds images.
  TurnAgreement agreement() const { return watch_.agreement(); }

 private:
  static constexpr double kNothingFades_s = 1e9;
  std::mutex mutex_;
  std::vector<ImuSample> readings_;  ///< not yet taken by the images' thread
  TurnWatch watch_;
};

/// `R_BC`, `time_offset_s`: the configured values.
Findings findings_of(const TurnAgreement& agreement, const Mat3& R_BC, double time_offset_s);

}  // namespace epiline
