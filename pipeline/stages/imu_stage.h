#pragma once
// Carries IMU samples to the stages that use them.
#include <array>
#include <vector>

#include "pipeline/config/calibration.h"
#include "pipeline/stages/hand_over.h"
#include "pipeline/stages/source_stage.h"
#include "pipeline/watch/health_merge.h"
#include "pipeline/watch/imu_gate.h"
#include "platform/concurrency/parking.h"

namespace epiline {

/// Judges every sample, and passes accepted ones to every reader, corrected.
class ImuStage final : public SourceStage {
 public:
  struct Reader {
    ImuRing* ring = nullptr;  ///< a full one refuses, and counts
    Parking* parking = nullptr;
  };
  struct Outputs {
    std::vector<Reader> readers;
    Heard& heard;
    EventRing& events;
    ImuLogRing* log = nullptr;  ///< or null; gets each reading as it came
  };

  /// `imu` is null where only take() is called.
  ImuStage(ImuSource* imu, const ImuLimits& limits, const ImuCorrection& correction, const FlightClock& clock,
           const Outputs& out)
      : SourceStage(EventSource::kImu, clock, out.events),
        imu_(imu),
        out_(out),
        gate_(limits),
        correction_(correction),
        events_(out.events) {}

  /// Passes a sample through the gate, which may correct its timestamp, and corrected to the readers' rings. False:
  /// dropped.
  bool take(ImuSample& reading) noexcept;

  std::uint64_t readings() const noexcept { return readings_.get(); }  ///< that came
  const ImuGateStats& watch() const noexcept { return gate_.stats(); }

 private:
  ReadOutcome read() noexcept override { return imu_->read(batch_, count_, kIdle); }
  void use() noexcept override;

  ImuSource* imu_;
  Outputs out_;
  std::array<ImuSample, 64> batch_;
  std::size_t count_ = 0;
  ImuGate gate_;
  ImuCorrection correction_;
  ImuEvents events_;
  LastHeard times_;
  StageCount readings_;
};

}  // namespace epiline
