#pragma once
#include "pipeline/library/epiline.h"
#include "pipeline/stages/frame_outcome.h"

namespace epiline {

/// What the C interface tells of an image.
epiline_state state_of(const FrameOutcome& outcome) noexcept;

}  // namespace epiline
