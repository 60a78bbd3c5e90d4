#pragma once
// A frame at rest has no velocity, and the pose of its rest frame. Derivation: docs/derivations/zero_motion.md;
// test: tests/estimator/factors/zero_motion_test.cc.
#include "estimator/factors/normal_equations.h"
#include "estimator/window/window.h"

namespace epiline {

inline constexpr double kRestVelocitySigma = 0.01;                                 ///< m/s
inline constexpr double kRestPositionSigma = 0.003;                                ///< m
inline constexpr double kShakenVelocitySigma = 0.1, kShakenPositionSigma = 0.005;  ///< m/s, m: Slot::shaken
inline constexpr double kRestAttitudeSigma = 3e-4;  ///< rad: what the test for rest overlooks in the images

/// Returns the cost; null: the cost alone.
double add_zero_motion(const Window& window, const Share& share, NormalEquations* out);

}  // namespace epiline
