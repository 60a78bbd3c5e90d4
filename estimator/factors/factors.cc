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
FactorCost add_all(const Window& w, const Share& share, const FactorKernels& kernels, NormalEquations* out) {
  double cost = add_prior(w, out);
  cost += add_calibration_prior(w, share, out);
  cost += add_zero_motion(w, share, out);
  cost += add_wheel(w, share, out);
  cost += add_height(w, share, out);
  cost += add_beam(w, share, out);
  const double imu = add_imu(w, share, kernels, out);
  return {cost + imu, imu};
}
}  // namespace

FactorCost add_factors(const Window& w, const VisualSystem& visual, const Share& share, const FactorKernels& kernels,
                       NormalEquations& out) {
  add_visual(w, visual, share.frames, out);
  const FactorCost cost = add_all(w, share, kernels, &out);
  return {visual.cost + cost.all, cost.imu};
}

double cost_without_vision(const Window& w, const FactorKernels& kernels) {
  return add_all(w, {w.size(), false}, kernels, nullptr).all;
}

}  // namespace epiline
