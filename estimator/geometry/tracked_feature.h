#pragma once
#include "estimator/geometry/camera.h"
#include "platform/samples/samples.h"

namespace epiline {

/// Converts a tracked point to the estimator's input: pixel, bearing, Jacobian of the pixel, and time of its
/// row. `px`: raw pixel.
/// False, and nothing is written, if the pixel has no bearing (Camera::bearing).
bool set_pixel(const Camera& camera, const Vec2& px, TrackedFeature& feature) noexcept;

}  // namespace epiline
