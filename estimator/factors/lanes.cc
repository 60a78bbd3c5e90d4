#include "estimator/factors/lanes.h"

#include "estimator/factors/calibration.h"

namespace epiline {

void fill_geometry(const Window& w, int frames, const Vec3& origin, FrameGeometry* out) {
  for (int k = 0; k < frames; ++k) {
    const ExposedFrame f = exposed_frame(w, k);
    Eigen::Map<RowMat3>(out[k].R_WC) = f.R_WC;
    Eigen::Map<Vec3>(out[k].c) = f.c - origin;
    Eigen::Map<Vec3>(out[k].p) = f.p - origin;
  }
}

using Row6 = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;

void move_to_bodies(const FrameGeometry* frame, int frames, VisualSystem& s) {
  Mat3 P[kMaxFrames];
  for (int k = 0; k < frames; ++k) P[k] = skew(Eigen::Map<const Vec3>(frame[k].p));
  for (int k = 0; k < frames; ++k) {
    for (int l = k; l < frames; ++l) {
      Eigen::Map<Row6> H(s.H[k][l]);
      H.rightCols<3>() += H.leftCols<3>().lazyProduct(P[l]).eval();
      H.bottomRows<3>() -= P[k].lazyProduct(H.topRows<3>()).eval();
    }
    Eigen::Map<Vec6> b(s.b[k]);
    b.tail<3>() -= P[k].lazyProduct(b.head<3>()).eval();
  }
}

}  // namespace epiline
