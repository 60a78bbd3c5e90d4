#pragma once
// From tracked frames to estimates.
#include <optional>

#include "pipeline/stages/back_end.h"
#include "pipeline/stages/estimator_events.h"
#include "pipeline/stages/hand_over.h"
#include "pipeline/stages/imu_intake.h"
#include "platform/concurrency/parking.h"

namespace epiline {

struct EstimateStageSettings {
  EstimatorConfig estimator;
  double solve_ms = 0;     ///< for the solve of one image; 0: as long as it takes
  double deadline_ms = 0;  ///< from an image's stamp to its odometry; 0: as long as it takes
  Span imu_patience{};     ///< ImuIntake
};

/// Estimates one image a step, once the IMU samples up to its time have arrived.
class EstimateStage final : public Stage {
 public:
  struct Inputs {
    TrackedRing& tracked;
    const EndMark& tracker_ended;
    ImuRing& imu;
    const EndMark& imu_ended;
    WheelRing& speeds;  ///< images do not wait for speeds or heights
    HeightRing& heights;
  };
  /// Rings to the log.
  struct Log {
    OutcomeRing& outcomes;
    TracksLogRing& tracks;
    Parking& parking;
  };
  struct Outputs {
    KnowledgeRing& knowledge;
    Parking& tracker;
    EventRing& events;
    LatestValue<Estimate>* newest = nullptr;  ///< or null, and then there is no publisher
    Parking* publisher = nullptr;
    std::optional<Log> log = std::nullopt;
  };

  EstimateStage(const EstimateStageSettings& settings, const FlightClock& clock, const Inputs& in, const Outputs& out);

  Step step() noexcept override;
  bool ready() noexcept override;

  HostStamp imu_needed_until(HostStamp image) const noexcept { return back_end_.imu_needed_until(image); }
  /// The estimator's present knowledge for the tracker; before any image, the initial one.
  Knowledge knowledge() const noexcept { return knowledge_of(back_end_); }
  /// Outcome of the last image.
  const FrameOutcome& outcome() const noexcept { return outcome_; }

  std::uint64_t images() const noexcept { return images_.get(); }  ///< estimated
  std::uint64_t imu_late() const noexcept { return imu_.late(); }
  const BackEnd& back_end() const noexcept { return back_end_; }

 private:
  void give(const ImuSample& reading) noexcept;
  void take_side_samples() noexcept;
  Step wait_for_image(bool over) noexcept;
  void estimate(const Tracked& image) noexcept;
  void hand_to_publisher(const StepResult& result) noexcept;
  void hand_to_log(const TrackedFrame& frame) noexcept;
  std::int64_t deadline_of(HostStamp image) const noexcept;

  FlightClock clock_;
  double deadline_ms_;
  Inputs in_;
  Outputs out_;
  BackEnd back_end_;
  EstimatorEvents events_;
  ImuIntake imu_;
  FrameOutcome outcome_;
  std::uint64_t solved_serial_ = 0;
  Odometry solved_;
  StageCount images_;
};

}  // namespace epiline
