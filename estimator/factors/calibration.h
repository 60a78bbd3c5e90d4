#pragma once
// Time offset and extrinsics in any visual factor: whatever they do to a camera, some motion of its body does too, so
// their columns follow from the pose blocks. Those of the lens are the factor's own. Derivation:
// docs/derivations/calibration.md; test: tests/estimator/factors/gradient_test.cc.
#include "estimator/factors/kernels.h"
#include "estimator/window/window.h"

namespace epiline {

/// Frame k at the exposure, as the present estimate of the time offset places it.
struct ExposedFrame {
  Mat3 R_WB, R_WC;
  Vec3 p;  ///< of the body
  Vec3 c;  ///< of the camera
  Vec3 v, omega_W;
};
ExposedFrame exposed_frame(const Window& window, int k);

/// Length of the steps between the first `frames` frames together, root of the sum of squares.
double way_m(const Window& window, int frames);

/// Fills H_ck, H_cc and b_c from the pose blocks H and b of the first `frames` frames. Columns: time offset, rotation
/// of R_BC on the right, p_BC, the lens (from its columns); all but the first only if asked for, else zero. If
/// `held_m` is the way for which velocities were held, the pace's column goes into the positions that it follows from.
void add_calibration(const Window& window, int frames, bool extrinsics, bool lens, const FactorKernels& kernels,
                     VisualSystem& system, double held_m = 0);

}  // namespace epiline
