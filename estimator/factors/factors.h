#pragma once
// The one list of all factors: a new one joins it here.
#include "estimator/factors/visual.h"

namespace epiline {

struct FactorCost {
  double all = 0;
  double imu = 0;  ///< of it, the intervals of the IMU
};

/// Adds every factor of the share. Visual factors are given as `visual` has them.
FactorCost add_factors(const Window& window, const VisualSystem& visual, const Share& share,
                       const FactorKernels& kernels, NormalEquations& out);

/// The cost of all factors but the visual ones.
double cost_without_vision(const Window& window, const FactorKernels& kernels);

}  // namespace epiline
