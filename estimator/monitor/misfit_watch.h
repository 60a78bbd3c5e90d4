#pragma once
// By how much images and IMU contradict each other. docs/derivations/turns.md, `misfit`.
#include <algorithm>

#include "estimator/factors/visual.h"

namespace epiline {

class MisfitWatch {
 public:
  /// Residuals in a solved window; `dt_s` since the solve before. A contradiction is believed within a second. Only
  /// motion that fits refutes it, and later: at rest any calibration fits.
  void add(const ResidualNoise& residual, double dt_s, bool at_rest) noexcept {
    const double seen = std::min({residual.median_px, kFitsAll * residual.quarter_px, kMost_px});
    const bool refutes = seen < misfit_px_;
    if (refutes && at_rest) return;
    misfit_px_ += std::min(1.0, dt_s / (refutes ? refuted_s_ : kBelieved_s)) * (seen - misfit_px_);
  }
  /// A new start may try again, but what contradicted before is not trusted yet: calibration is the rig's, not the
  /// start's. A gentle flight fits many a wrong number, so each one that a contradiction ended makes refuting take
  /// twice as long.
  void restart() noexcept {
    if (misfit_px_ <= kRemembered_px) return;
    misfit_px_ = kRemembered_px;
    refuted_s_ *= 2;
  }
  double px() const noexcept { return misfit_px_; }

 private:
  static constexpr double kBelieved_s = 1, kMost_px = 10;
  // Wrong numbers move all tracks: the best quarter misses by 0.4 to 0.7 times the median. What slides along edges, or
  // moves by itself, leaves a quarter as it is: 0.01 times.
  static constexpr double kFitsAll = 4;
  static constexpr double kRemembered_px = 1.5;  // suspect, not gross (suspicion.cc): gross would refuse the start
  double misfit_px_ = 0, refuted_s_ = 5;
};

}  // namespace epiline
