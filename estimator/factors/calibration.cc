#include "estimator/factors/calibration.h"

#include <cstring>

namespace epiline {

using Row6 = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;

ExposedFrame exposed_frame(const Window& w, int k) {
  const Slot& s = w.at(k);
  const NavState& x = s.x;
  const double dt = w.calibration.time_offset - s.time_offset_used;
  const Vec3 omega_B = s.omega - x.b_g;
  ExposedFrame f;
  f.v = x.v;
  f.omega_W = x.R * omega_B;
  f.R_WB = dt == 0 ? x.R : Mat3(x.R * so3_exp(omega_B * dt));
  f.R_WC = f.R_WB * w.calibration.R_BC;
  f.p = x.p + x.v * dt;
  f.c = f.p + f.R_WB * w.calibration.p_BC;
  f.p_lin = w.linearisation_point(k).p + x.v * dt;
  return f;
}

namespace {
using Motions = Eigen::Matrix<double, 6, kFocalColumn>;

/// The motion (dp, dphi) of the body that moves the camera as each calibration parameter does.
Motions equivalent_motions(const ExposedFrame& f) {
  const Vec3 lever = f.c - f.p_lin;  // what the pose Jacobians turn about
  auto motion = [&](const Vec3& dc, const Vec3& dphi) {
    Vec6 d;
    d << dc - dphi.cross(lever), dphi;
    return d;
  };
  Motions m;
  m.col(0) = motion(f.v + f.omega_W.cross(f.c - f.p), f.omega_W);
  for (int i = 0; i < 3; ++i) {
    m.col(kRotationColumn + i) = motion(Vec3::Zero(), f.R_WC.col(i));
    m.col(kTranslationColumn + i) = motion(f.R_WB.col(i), Vec3::Zero());
  }
  return m;
}
}  // namespace

void add_calibration(const Window& w, int frames, bool extrinsics, bool focal, VisualSystem& s) {
  const int columns = extrinsics ? kFocalColumn : 1;
  Motions motion[kMaxFrames];
  for (int k = 0; k < frames; ++k) motion[k] = equivalent_motions(exposed_frame(w, k));
  std::memset(s.H_cc, 0, sizeof s.H_cc);
  std::memset(s.b_c, 0, sizeof s.b_c);
  std::memset(s.H_ck, 0, sizeof s.H_ck[0] * static_cast<std::size_t>(frames));
  for (int k = 0; k < frames; ++k)
    for (int l = k; l < frames; ++l) {
      const Eigen::Map<const Row6> H(s.H[k][l]);
      for (int c = 0; c < columns; ++c) {
        Eigen::Map<Vec6>(s.H_ck[l] + 6 * c) += H.transpose().lazyProduct(motion[k].col(c));
        if (l > k) Eigen::Map<Vec6>(s.H_ck[k] + 6 * c) += H.lazyProduct(motion[l].col(c));
      }
    }
  for (int k = 0; k < frames; ++k)
    for (int c = 0; c < columns; ++c) {
      s.b_c[c] += motion[k].col(c).dot(Eigen::Map<const Vec6>(s.b[k]));
      for (int d = 0; d < columns; ++d)
        s.H_cc[kCameraCalibration * c + d] += motion[k].col(c).dot(Eigen::Map<const Vec6>(s.H_ck[k] + 6 * d));
    }
  if (!focal) return;
  Eigen::Map<Eigen::Matrix<double, kCameraCalibration, kCameraCalibration>> H_cc(s.H_cc);
  for (int k = 0; k < frames; ++k) {
    const Eigen::Map<const Vec6> H_lens(s.H_lens[k]);
    Eigen::Map<Vec6>(s.H_ck[k] + 6 * kFocalColumn) = H_lens;
    for (int c = 0; c < columns; ++c) H_cc(c, kFocalColumn) += motion[k].col(c).dot(H_lens);
  }
  for (int c = 0; c < columns; ++c) H_cc(kFocalColumn, c) = H_cc(c, kFocalColumn);
  H_cc(kFocalColumn, kFocalColumn) = s.H_lens_lens;
  s.b_c[kFocalColumn] = s.b_lens;
}

}  // namespace epiline
