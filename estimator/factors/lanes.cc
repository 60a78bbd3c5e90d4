#include "estimator/factors/lanes.h"

#include <cstring>

#include "estimator/factors/calibration.h"

namespace epiline {

void clear(TrackBatch& batch, int first, int last) {
  batch.first = first;
  batch.last = last;
  std::memset(batch.observation[first], 0, sizeof batch.observation[0] * static_cast<std::size_t>(last - first + 1));
  std::memset(batch.views, 0, sizeof batch.views);
  std::memset(batch.warm, 0, sizeof batch.warm);
}

void fill_geometry(const Window& w, int frames, const Vec3& origin, FrameGeometry* out) {
  for (int k = 0; k < frames; ++k) {
    const ExposedFrame f = exposed_frame(w, k);
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(out[k].R_WC) = f.R_WC;
    Eigen::Map<Vec3>(out[k].c) = f.c - origin;
    Eigen::Map<Vec3>(out[k].p) = f.p_lin - origin;
  }
}

}  // namespace epiline
