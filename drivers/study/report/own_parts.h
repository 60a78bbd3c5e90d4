#pragma once
// Where the camera saw the vehicle itself, as a picture for `camera.mask`.
#include <string>

#include "pipeline/vision/tracker_config.h"

namespace epiline {

/// Share of the grid's cells.
double own_share(const OwnCells& cells);
/// A PNG file of the camera's size: black where the vehicle is seen, else white.
std::string own_parts_png(const OwnCells& cells);

}  // namespace epiline
