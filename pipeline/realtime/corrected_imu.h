#pragma once
// An IMU with wrong scales or axes, and its calibration.
#include <memory>
#include <utility>

#include "pipeline/config/calibration.h"
#include "platform/ports/ports.h"

namespace epiline {

/// An IMU whose readings are corrected as they come.
class CorrectedImu final : public ImuSource {
 public:
  CorrectedImu(std::unique_ptr<ImuSource> imu, const ImuCorrection& correction)
      : imu_(std::move(imu)), correction_(correction) {}
  Status open() override { return imu_->open(); }
  void give_up() noexcept override { imu_->give_up(); }
  void close() noexcept override { imu_->close(); }
  ReadOutcome read(std::span<ImuSample> samples, std::size_t& count, Span timeout) noexcept override {
    const ReadOutcome outcome = imu_->read(samples, count, timeout);
    if (outcome == ReadOutcome::kSample)
      for (ImuSample& sample : samples.first(count)) correction_.apply(sample);
    return outcome;
  }

 private:
  std::unique_ptr<ImuSource> imu_;
  ImuCorrection correction_;
};

}  // namespace epiline
