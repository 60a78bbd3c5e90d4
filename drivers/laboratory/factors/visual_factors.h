#pragma once
// The visual factors that are compared, by name.
#include <array>
#include <string>

#include "estimator/config.h"

namespace epiline {

/// The estimator's own, the paper's, and that of VINS-Mono with landmarks in the state.
inline constexpr std::array kVisualFactorNames = {"track", "epipolar", "reprojection"};

/// Gives an estimator with these settings one of them, and turns off what that one lacks: drifting tracks with the
/// cameras beside the first one, and a column of the focal length.
void choose_visual_factor(const std::string& name, EstimatorConfig& config);

}  // namespace epiline
