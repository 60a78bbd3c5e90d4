#pragma once
// Layout of frames and bearings for the kernels that process eight tracks at a time.
#include "estimator/factors/kernels.h"
#include "estimator/window/window.h"

namespace epiline {

/// Writes one view into a lane; `inverse_sigma` whitens its Jacobian.
inline void put_view(const Observation& o, double inverse_sigma, int frame, int lane, TrackBatch& batch) {
  double(*d)[kBatchLanes] = batch.observation[frame];
  for (int i = 0; i < 3; ++i) {
    d[TrackBatch::kBearing + i][lane] = o.f_C[i];
    d[TrackBatch::kChart + i][lane] = inverse_sigma * o.chart(0, i);
    d[TrackBatch::kChart + 3 + i][lane] = inverse_sigma * o.chart(1, i);
  }
  d[TrackBatch::kStretch][lane] = static_cast<double>(o.stretch);
  d[TrackBatch::kRow][lane] = static_cast<double>(o.row_s);
}

/// An absent view.
inline void put_nothing(int frame, int lane, TrackBatch& batch) {
  for (double(&numbers)[kBatchLanes] : batch.observation[frame]) numbers[lane] = 0;
}

/// No views from frame `first` to `last`, no tracks.
void clear(TrackBatch& batch, int first, int last);

/// The first `frames` frames at their exposure, relative to `origin`. If `origin` is the newest body's position, or a
/// recent one, differences of positions stay small far from the start.
void fill_geometry(const Window& window, int frames, const Vec3& origin, FrameGeometry* out);

/// From displacements about the common origin to those about the bodies: H <- T' H T, T_k = [I, [p_k]x; 0, I].
void move_to_bodies(const FrameGeometry* frame, int frames, VisualSystem& system);

}  // namespace epiline
