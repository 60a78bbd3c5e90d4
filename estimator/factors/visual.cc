#include "estimator/factors/visual.h"

#include <cstring>

namespace epiline {

namespace {
using Row6 = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;
using CalibrationColumns = Eigen::Matrix<double, 6, kCameraCalibration>;

/// A world-frame pair block turned into body tangents: delta phi = R delta theta.
Row6 to_body(const double* block, const Mat3& R_k, const Mat3& R_l) {
  const Eigen::Map<const Row6> B(block);
  Row6 T;
  T.topLeftCorner<3, 3>() = B.topLeftCorner<3, 3>();
  T.topRightCorner<3, 3>() = B.topRightCorner<3, 3>().lazyProduct(R_l);
  T.bottomLeftCorner<3, 3>() = R_k.transpose().lazyProduct(B.bottomLeftCorner<3, 3>());
  const RowMat3 M = R_k.transpose().lazyProduct(B.bottomRightCorner<3, 3>());
  T.bottomRightCorner<3, 3>() = M.lazyProduct(R_l);
  return T;
}

/// The same of rows alone.
template <class Rows>
void turn_rows(const Mat3& R_k, Rows& rows) {
  rows.template bottomRows<3>() = (R_k.transpose() * rows.template bottomRows<3>()).eval();
}
}  // namespace

void clear(VisualSystem& s, int frames) {
  for (int k = 0; k < frames; ++k) {
    for (int l = k; l < frames; ++l) std::memset(s.H[k][l], 0, sizeof s.H[k][l]);
    std::memset(s.b[k], 0, sizeof s.b[k]);
    std::memset(s.H_ck[k], 0, sizeof s.H_ck[k]);
  }
  std::memset(s.H_cc, 0, sizeof s.H_cc);
  std::memset(s.b_c, 0, sizeof s.b_c);
  s.cost = 0;
  s.residuals = s.tracks = s.gated = 0;
}

void add_visual(const Window& w, const VisualSystem& v, int frames, NormalEquations& out) {
  Mat3 R[kMaxFrames];
  for (int k = 0; k < frames; ++k) R[k] = w.at(k).x.R;
  for (int k = 0; k < frames; ++k) {
    for (int l = k; l < frames; ++l) out.add(pose_of(k), pose_of(l), to_body(v.H[k][l], R[k], R[l]));
    Vec6 b = Eigen::Map<const Vec6>(v.b[k]);
    turn_rows(R[k], b);
    out.add(pose_of(k), b);
    CalibrationColumns H_ck = Eigen::Map<const CalibrationColumns>(v.H_ck[k]);
    turn_rows(R[k], H_ck);
    out.add(pose_of(k), calibration_of_camera(), H_ck);
  }
  out.add(calibration_of_camera(), Eigen::Map<const Eigen::Matrix<double, kCameraCalibration, 1>>(v.b_c));
  out.add(calibration_of_camera(), calibration_of_camera(),
          Eigen::Map<const Eigen::Matrix<double, kCameraCalibration, kCameraCalibration>>(v.H_cc));
}

}  // namespace epiline
