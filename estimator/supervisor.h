#pragma once
#include <cstdint>

namespace epiline {

/// What the estimator may ask of the outside while it works. Both calls must return at once.
class Supervisor {
 public:
  enum class Phase : std::uint8_t { kNone, kSolve, kMarginalise };
  /// What a frame may cost.
  struct Effort {
    bool solve = true;    ///< false: the IMU predicts this frame
    int most_tracks = 0;  ///< in the solve and in what leaves the window; 0: all
    int most_steps = 0;   ///< 0: as configured; 1: one step, accepted without being tried
    bool reduced() const { return !solve || most_tracks > 0 || most_steps > 0; }
  };
  virtual ~Supervisor() = default;
  /// Asked once for each frame that is due to be solved. Starts are not asked for: they take what they need.
  virtual Effort effort() noexcept { return {}; }
  /// Asked between solver steps; true: there is no time for another, return the best accepted iterate now.
  virtual bool time_is_up() noexcept { return false; }
  /// The phase that begins now (kNone: bookkeeping), for a caller that measures time.
  virtual void phase(Phase) noexcept {}
};

}  // namespace epiline
