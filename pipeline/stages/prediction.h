#pragma once
// The odometry between images: the predictor, corrected with what the estimator solved.
#include "estimator/predict/predictor.h"
#include "pipeline/stages/hand_over.h"

namespace epiline {

class Prediction {
 public:
  explicit Prediction(const EstimatorConfig& estimator) noexcept : predictor_(predictor_config(estimator)) {}

  /// The newest estimate, once. Corrects only with what was solved: the odometry of an image in between is itself a
  /// prediction.
  void correct(const Estimate& newest) noexcept;
  /// Carries the state on over a reading. True: there is odometry of its instant.
  bool step(const ImuSample& reading) noexcept;

  bool has_odometry() const noexcept { return predictor_.state() != Predictor::State::kWaiting; }
  /// At the last reading. `newest`: the estimate, whose health is the verdict as long as the last solve is not old:
  /// that on the last image may be worse than that on the last solve. May be null.
  Odometry odometry(const Estimate* newest) const noexcept;

  const PredictorStats& stats() const noexcept { return predictor_.stats(); }

 private:
  Predictor predictor_;
  std::uint64_t corrected_with_ = 0;  ///< Estimate::solved_serial
  std::uint32_t resets_seen_ = 0;
};

}  // namespace epiline
