#pragma once
// The worlds, each built around the box that the camera's path fills. They return the space that movers walk in.
#include "drivers/laboratory/render/world_builder.h"

namespace epiline {

Bounds hall(WorldBuilder& b, Bounds box);
Bounds room(WorldBuilder& b, Bounds box);
Bounds corridor(WorldBuilder& b, Bounds box);
Bounds outdoor(WorldBuilder& b, Bounds box);
/// Ground whose texture suits the height it is seen from: finer patches lie a little above the coarser ones.
Bounds fields(WorldBuilder& b, Bounds box);

}  // namespace epiline
