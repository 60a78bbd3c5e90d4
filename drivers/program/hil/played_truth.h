#pragma once
// The recorded truth of a played flight, at the time of this computer's clock.
#include <optional>

#include "drivers/program/hil/fusion_model.h"
#include "pipeline/text/trajectory.h"
#include "platform/time/monotonic.h"

namespace epiline::hil {

class PlayedTruth {
 public:
  /// `truth` outlives it, and may be null: then nothing is known.
  explicit PlayedTruth(const Trajectory* truth) : truth_(truth) {}
  /// None outside the truth and in its gaps.
  std::optional<TruthState> at(HostStamp recorded) const;

 private:
  const Trajectory* truth_;
};

/// The poses at the times at which they were played.
Trajectory played(const Trajectory& truth, const Pace& pace);

}  // namespace epiline::hil
