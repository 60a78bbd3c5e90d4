#include "drivers/laboratory/factors/visual_factors.h"

#include <memory>

#include "drivers/laboratory/factors/epipolar.h"
#include "drivers/laboratory/factors/reprojection.h"

namespace epiline {

namespace {
template <class Factor>
std::unique_ptr<VisualFactorModel> make(InstructionSet set) {
  return std::make_unique<Factor>(set);
}
}  // namespace

void choose_visual_factor(const std::string& name, EstimatorConfig& config) {
  for (const VisualFactor& factor :
       {VisualFactor{"epipolar", make<EpipolarFactor>}, VisualFactor{"reprojection", make<ReprojectionFactor>}}) {
    if (name != factor.name) continue;
    config.visual_factor = factor;
    config.track_noise = TrackNoiseModel::kWhite;
    config.estimate_focal_length = false;
  }
}

}  // namespace epiline
