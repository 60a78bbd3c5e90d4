#pragma once
// Layout of frames and bearings for the kernels that process eight tracks at a time.
#include "estimator/factors/kernels.h"
#include "estimator/window/window.h"

namespace epiline {

/// Views of a batch, slot by slot; kNoView: none.
using BatchViews = const Observation* [kMaxSlots][kBatchLanes];

/// The first `frames` frames at their exposure, relative to `origin`. If `origin` is the newest body's position, or a
/// recent one, differences of positions stay small far from the start.
void fill_geometry(const Window& window, int frames, const Vec3& origin, FrameGeometry* out);

/// From displacements about the common origin to those about the bodies: H <- T' H T, T_k = [I, [p_k]x; 0, I].
void move_to_bodies(const FrameGeometry* frame, int frames, VisualSystem& system);

}  // namespace epiline
