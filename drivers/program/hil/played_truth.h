#pragma once
// Ground truth of a played flight.
#include <optional>

#include "drivers/program/hil/fusion_model.h"
#include "pipeline/text/trajectory.h"
#include "platform/time/monotonic.h"

namespace epiline::hil {

class PlayedTruth {
 public:
  /// `truth` must outlive this object; null: there is no ground truth.
  explicit PlayedTruth(const Trajectory* truth) : truth_(truth) {}
  /// The state at a timestamp of the recording; none outside of the ground truth and in its gaps.
  std::optional<TruthState> at(HostStamp recorded) const;

 private:
  const Trajectory* truth_;
};

/// The same poses, with timestamps moved to the times at which they were played.
Trajectory played(const Trajectory& truth, const Pace& pace);

}  // namespace epiline::hil
