#include "estimator/factors/factors.h"

#include "estimator/factors/beam.h"
#include "estimator/factors/calibration_prior.h"
#include "estimator/factors/height.h"
#include "estimator/factors/imu.h"
#include "estimator/factors/prior.h"
#include "estimator/factors/wheel.h"
#include "estimator/factors/zero_motion.h"

namespace epiline {

namespace {
double add_all(const Window& w, const Share& share, const FactorKernels& kernels, NormalEquations* out) {
  double cost = add_prior(w, out);
  cost += add_calibration_prior(w, share, out);
  cost += add_zero_motion(w, share, out);
  cost += add_wheel(w, share, out);
  cost += add_height(w, share, out);
  cost += add_beam(w, share, out);
  cost += add_imu(w, share, kernels, out);
  return cost;
}
}  // namespace

double add_factors(const Window& w, const VisualSystem& visual, const Share& share, const FactorKernels& kernels,
                   NormalEquations& out) {
  add_visual(w, visual, share.frames, out);
  return visual.cost + add_all(w, share, kernels, &out);
}

double cost_without_vision(const Window& w, const FactorKernels& kernels) {
  return add_all(w, {w.size(), false}, kernels, nullptr);
}

}  // namespace epiline
