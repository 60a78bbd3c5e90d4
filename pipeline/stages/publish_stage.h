#pragma once
// From estimates and readings of the IMU to the receiver of the odometry.
#include "estimator/predict/predictor.h"
#include "pipeline/stages/hand_over.h"
#include "pipeline/stages/stage.h"
#include "pipeline/stages/stage_clocks.h"
#include "pipeline/watch/health_merge.h"
#include "platform/concurrency/parking.h"
#include "platform/ports/ports.h"
#include "platform/time/latency_bins.h"

namespace epiline {

/// Hands out one odometry a step: the newest image's, or else the prediction at the next reading, which is corrected
/// with what the estimator solved: the odometry of an image in between is itself a prediction. When nothing new
/// comes because a sensor is silent, the last prediction goes out again with the health of now: no other stage would
/// tell the receiver.
class PublishStage final : public Stage {
 public:
  struct Inputs {
    LatestValue<Estimate>& newest;
    const EndMark& estimator_ended;
    ImuRing& imu;
    const Heard& camera_heard;
    const EndMark& camera_ended;
    const Heard& imu_heard;
    const EndMark& imu_ended;
  };
  struct Outputs {
    OdometrySink* odometry = nullptr;  ///< or null
    PublicationRing& publications;
    Parking& log;
  };
  struct Counts {
    StageCount published;  ///< estimates that came here, with a pose or without
    StageCount publish_failed, predicted, predict_failed;
    StageCount late;  ///< images' odometry that left after the deadline
  };

  /// `deadline_ms`: from an image's stamp to its odometry; 0: none.
  PublishStage(const EstimatorConfig& estimator, double deadline_ms, const FlightClock& clock, const Inputs& in,
               const Outputs& out)
      : clock_(clock), deadline_ms_(deadline_ms), in_(in), out_(out), predictor_(predictor_config(estimator)) {}

  Step step() noexcept override;
  bool ready() noexcept override;

  const Counts& counts() const noexcept { return counts_; }
  const PredictorStats& prediction() const noexcept { return predictor_.stats(); }
  const LatencyBins& prediction_latency() const noexcept { return prediction_latency_; }

 private:
  const Estimate* new_estimate() noexcept;
  void publish(const Estimate& estimate) noexcept;
  void correct(const Estimate& newest) noexcept;
  void publish_prediction(const ImuSample& reading) noexcept;
  void publish_silence() noexcept;
  Step nothing_new() noexcept;
  Odometry prediction_now() noexcept;
  Health health_now(const Health& health) const noexcept;

  FlightClock clock_;
  double deadline_ms_;
  Inputs in_;
  Outputs out_;
  Predictor predictor_;
  std::uint64_t last_serial_ = 0, corrected_with_ = 0;  ///< of an Estimate; its solved_serial
  std::uint32_t resets_seen_ = 0;
  std::int64_t silent_from_ns_ = 0;  ///< if nothing comes until then; 0: something has just come
  LatencyBins prediction_latency_;
  Counts counts_;
};

}  // namespace epiline
