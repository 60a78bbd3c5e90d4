#pragma once
#include "estimator/geometry/camera.h"
#include "platform/samples/samples.h"

namespace epiline {

/// Where a tracker found a point, as the estimator takes it: pixel, bearing and the bearing's noise. `px`: raw pixel.
/// False, and nothing is written, where the pixel has no bearing (Camera::bearing).
bool set_pixel(const Camera& camera, const Vec2& px, TrackedFeature& feature) noexcept;

}  // namespace epiline
