#pragma once
#include "estimator/factors/visual.h"

namespace epiline::test {

/// No gate and next to no kernel; every point converged, so that the cost is a function of the poses.
inline VisualSettings smooth_settings() {
  VisualSettings s;
  s.pixel_sigma = 1;
  s.sigma_inflation = 1;
  s.cauchy = 10;
  s.gate = false;
  s.extrinsics = true;
  s.lens = true;
  s.inner_steps = 40;
  s.converged = 0;
  return s;
}

}  // namespace epiline::test
