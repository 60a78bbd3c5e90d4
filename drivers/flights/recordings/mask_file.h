#pragma once
#include <cstddef>

#include "estimator/geometry/camera.h"
#include "pipeline/config/config.h"

namespace epiline {

/// Reads the mask that the configuration names for camera `number`, if any. Fails if and only if it cannot be read as
/// an image, has another size than the camera's images, or is black everywhere.
Status read_mask(std::size_t number, const CameraParameters& camera, Config& config);

}  // namespace epiline
