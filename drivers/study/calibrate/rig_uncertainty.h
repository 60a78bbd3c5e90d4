#pragma once
// What the constants of a calibration are good to: not only what white noise would leave, but what the measurements'
// own agreement shows. Method: docs/derivations/rig.md#uncertainty.
#include <vector>

#include "drivers/study/calibrate/rig_factors.h"
#include "drivers/study/calibrate/rig_fit.h"

namespace epiline {

struct RigView {
  double t_s;  ///< the stamp, since the splines' begin
  const CornerView* view;
};

struct RigProblem {
  std::vector<RigReading> readings;
  std::vector<RigView> views;
  RigNoise noise;
};

/// A reading's residual with its weight, large ones counting less.
FitResidual weighted(FitResidual r, double sigma);
double corner_weight(const Vec2& e_px, const RigNoise& noise);

/// At the fit. `equations`: as solved there. Each sigma is the largest of several: by the equations, which take every
/// measurement's error for independent of all others; and by how far the pulls of the measurements of one stretch of
/// time, one corner of the board, one part of the image scatter, whatever the reason.
RigUncertainty uncertainty_of(const RigState& state, const RigLayout& layout, const FitEquations& equations,
                              const RigProblem& problem);

}  // namespace epiline
