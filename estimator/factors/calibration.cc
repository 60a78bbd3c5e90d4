#include "estimator/factors/calibration.h"

namespace epiline {

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
  return f;
}

namespace {
using Motions = Eigen::Map<Eigen::Matrix<double, 6, kCameraCalibration, Eigen::RowMajor>>;

/// The motion (dp, dphi) of the body that moves the camera as each calibration parameter does.
void fill_motions(const ExposedFrame& f, bool extrinsics, Motions m) {
  const Vec3 lever = f.c - f.p;  // what the pose Jacobians turn about
  auto motion = [&](const Vec3& dc, const Vec3& dphi) {
    Vec6 d;
    d << dc - dphi.cross(lever), dphi;
    return d;
  };
  m.setZero();
  m.col(kTimeOffsetColumn) = motion(f.v + f.omega_W.cross(f.c - f.p), f.omega_W);
  for (int i = 0; i < 3 && extrinsics; ++i) {
    m.col(kRotationColumn + i) = motion(Vec3::Zero(), f.R_WC.col(i));
    m.col(kTranslationColumn + i) = motion(f.R_WB.col(i), Vec3::Zero());
  }
}
}  // namespace

void add_calibration(const Window& w, int frames, bool extrinsics, bool focal, const FactorKernels& kernels,
                     VisualSystem& s) {
  alignas(64) double motion[kMaxFrames][6][kCameraCalibration];
  for (int k = 0; k < frames; ++k) fill_motions(exposed_frame(w, k), extrinsics, Motions(motion[k][0]));
  kernels.calibration(motion, frames, s);
  if (!focal) return;
  Eigen::Map<Eigen::Matrix<double, kCameraCalibration, kCameraCalibration>> H_cc(s.H_cc);
  for (int k = 0; k < frames; ++k) {
    const Eigen::Map<const Vec6> H_lens(s.H_lens[k]);
    Eigen::Map<Vec6>(s.H_ck[k] + 6 * kFocalColumn) = H_lens;
    H_cc.col(kFocalColumn) += Motions(motion[k][0]).transpose() * H_lens;
  }
  H_cc.row(kFocalColumn) = H_cc.col(kFocalColumn).transpose();
  H_cc(kFocalColumn, kFocalColumn) = s.H_lens_lens;
  s.b_c[kFocalColumn] = s.b_lens;
}

}  // namespace epiline
