#pragma once
#include "drivers/flights/recordings/grey_image.h"
#include "estimator/geometry/types.h"

namespace epiline {

/// Moves `px` to the corner nearby to which the image's gradients point at right angles (Forstner 1987): where two
/// edges meet, also four. `half`: of the window, px. False, with `px` as it was, where the window leaves the image, has
/// no corner, or the corner is not inside it.
bool refine_corner(const GreyPixels& image, int half, Vec2& px);

}  // namespace epiline
