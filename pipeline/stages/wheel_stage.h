#pragma once
// From the wheels to the estimator, which waits for none of their speeds.
#include "pipeline/stages/hand_over.h"
#include "pipeline/stages/source_stage.h"

namespace epiline {

/// Ends with the IMU and the camera: a flight is not longer for its wheels.
class WheelStage final : public SourceStage {
 public:
  struct Inputs {
    WheelSource* wheel = nullptr;
    const EndMark& imu_ended;
    const EndMark& camera_ended;
  };
  struct Outputs {
    WheelRing& speeds;  ///< a full one refuses, and counts
    EventRing& events;
    WheelLogRing& log;
  };

  WheelStage(const Inputs& in, const FlightClock& clock, const Outputs& out)
      : SourceStage(EventSource::kWheel, clock, out.events), in_(in), out_(out) {}

  std::uint64_t speeds() const noexcept { return speeds_.get(); }  ///< that came

 private:
  ReadOutcome read() noexcept override {
    if (in_.imu_ended.is_set() && in_.camera_ended.is_set()) return ReadOutcome::kEnd;
    return in_.wheel->read(speed_, kIdle);
  }
  void use() noexcept override {
    speeds_.bump();
    out_.speeds.push(speed_);
    out_.log.push(speed_);
  }

  Inputs in_;
  Outputs out_;
  WheelSample speed_;
  StageCount speeds_;
};

}  // namespace epiline
