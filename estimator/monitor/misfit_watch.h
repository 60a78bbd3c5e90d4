#pragma once
// By how much images and IMU contradict each other. docs/derivations/turns.md, `misfit`.
#include <algorithm>

namespace epiline {

class MisfitWatch {
 public:
  /// Residual of the tracks in a solved window, px; `dt_s` since the solve before. A contradiction is believed within a
  /// second. Only motion that fits refutes it, and later: at rest any calibration fits.
  void add(double residual_px, double dt_s, bool at_rest) noexcept {
    const double seen = std::min(residual_px, kMost_px);
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
  static constexpr double kRemembered_px = 1.5;  // suspect, not gross (suspicion.cc): gross would refuse the start
  double misfit_px_ = 0, refuted_s_ = 5;
};

}  // namespace epiline
