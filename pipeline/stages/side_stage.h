#pragma once
// From a sensor besides camera and IMU to the estimator, which waits for none of its samples.
#include "pipeline/stages/hand_over.h"
#include "pipeline/stages/source_stage.h"

namespace epiline {

/// Ends with the IMU and the camera: a flight is not longer for its wheels or its barometer.
template <class Sample>
class SideStage final : public SourceStage {
 public:
  struct Inputs {
    SampleSource<Sample>* source = nullptr;
    const EndMark& imu_ended;
    const EndMark& camera_ended;
  };
  struct Outputs {
    SideRing<Sample>& samples;  ///< a full one refuses, and counts
    EventRing& events;
    SideLogRing<Sample>& log;
  };

  SideStage(EventSource name, const Inputs& in, const FlightClock& clock, const Outputs& out)
      : SourceStage(name, clock, out.events), in_(in), out_(out) {}

  std::uint64_t samples() const noexcept { return samples_.get(); }  ///< that came

 private:
  ReadOutcome read() noexcept override {
    if (in_.imu_ended.is_set() && in_.camera_ended.is_set()) return ReadOutcome::kEnd;
    return in_.source->read(sample_, kIdle);
  }
  void use() noexcept override {
    samples_.bump();
    out_.samples.push(sample_);
    out_.log.push(sample_);
  }

  Inputs in_;
  Outputs out_;
  Sample sample_;
  StageCount samples_;
};

}  // namespace epiline
