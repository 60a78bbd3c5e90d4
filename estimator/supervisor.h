#pragma once
#include <cstdint>

namespace epiline {

/// Limits the effort of the estimator. The caller implements it; the estimator calls it while it works. The calls must
/// not block.
class Supervisor {
 public:
  enum class Phase : std::uint8_t { kNone, kSolve, kMarginalise };
  /// The effort allowed for one frame.
  struct Effort {
    bool solve = true;    ///< false: the IMU predicts this frame
    int most_tracks = 0;  ///< largest number of tracks in solve and marginalisation; 0: all
    int most_steps = 0;   ///< largest number of solver steps; 0: as configured; 1: one step, accepted untested
    bool reduced() const { return !solve || most_tracks > 0 || most_steps > 0; }
  };
  virtual ~Supervisor() = default;
  /// Called once per frame that is due for a solve. Not called for starts, which always run in full.
  virtual Effort effort() noexcept { return {}; }
  /// Called between solver steps. True: no time for another step; the solver returns its best accepted iterate.
  virtual bool time_is_up() noexcept { return false; }
  /// Called when a phase begins, for callers that measure time. kNone: anything else.
  virtual void phase(Phase) noexcept {}
};

}  // namespace epiline
