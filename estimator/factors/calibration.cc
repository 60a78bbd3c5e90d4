#include "estimator/factors/calibration.h"

#include <cmath>

namespace epiline {

namespace {
constexpr double kStays_m = 1e-4;    // a frame that moves by less until its exposure has the columns of its pose
constexpr double kLeastPace = 1e-4;  // below, a way that a step took away has no direction

/// From a frame's cut to its exposure.
double until_exposure_s(const Window& w, int k) { return w.calibration.time_offset - w.at(k).time_offset_used; }

/// Whether the interval to the next frame says how the velocity follows from both positions.
bool goes_on(const Window& w, int k) {
  return k + 1 < w.size() && w.at(k + 1).imu.knows_motion && w.at(k + 1).imu.T > 0;
}

/// What the forces until the next frame do to the mean velocity, in W.
Vec3 forced(const Window& w, int k) { return w.at(k).x.R * w.at(k + 1).imu.dp / w.at(k + 1).imu.T; }

/// The state's own velocity is in metres, and images don't know those: by the positions it grows with the scene.
Vec3 velocity_of(const Window& w, int k) {
  if (!goes_on(w, k)) return w.at(k).x.v;
  const double T = w.at(k + 1).imu.T;
  return (w.at(k + 1).x.p - w.at(k).x.p) / T - 0.5 * T * kGravity_W - forced(w, k);
}
}  // namespace

ExposedFrame exposed_frame(const Window& w, int k) {
  const Slot& s = w.at(k);
  const NavState& x = s.x;
  const double dt = until_exposure_s(w, k);
  const Vec3 omega_B = s.omega - x.b_g;
  ExposedFrame f;
  f.v = velocity_of(w, k);
  f.omega_W = x.R * omega_B;
  f.R_WB = dt == 0 ? x.R : Mat3(x.R * so3_exp(omega_B * dt));
  f.R_WC = f.R_WB * w.calibration.R_BC;
  f.p = x.p + f.v * dt;
  f.c = f.p + f.R_WB * w.calibration.p_BC;
  return f;
}

double way_m(const Window& w, int frames) {
  double squared = 0;
  for (int k = 1; k < frames; ++k) squared += (w.at(k).x.p - w.at(k - 1).x.p).squaredNorm();
  return std::sqrt(squared);
}

namespace {
using MotionRows = Eigen::Matrix<double, 6, kBatchLanes, Eigen::RowMajor>;
using Motions = Eigen::Map<MotionRows>;

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

/// From the poses of frames k and k + 1 at their exposures to their states: p'_k = p_k + dt v_k.
void move_to_states(const Window& w, int frames, int k, bool pace, VisualSystem& s) {
  using Block = Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>;
  using Columns = Eigen::Map<Eigen::Matrix<double, 6, kCameraCalibration>>;
  const double dt = until_exposure_s(w, k), share = dt / w.at(k + 1).imu.T;
  const Mat3 turn = dt * skew(forced(w, k));
  const auto move = [&](auto&& pose, auto&& next) {
    next.template topRows<3>() += share * pose.template topRows<3>();
    pose.template bottomRows<3>() += turn.transpose() * pose.template topRows<3>();
    pose.template topRows<3>() *= 1 - share;
  };
  for (int l = 0; l < k; ++l) move(Block(s.H[l][k]).transpose(), Block(s.H[l][k + 1]).transpose());
  for (int l = k + 2; l < frames; ++l) move(Block(s.H[k][l]), Block(s.H[k + 1][l]));
  Eigen::Matrix<double, 12, 12> both;
  both << Block(s.H[k][k]), Block(s.H[k][k + 1]), Block(s.H[k][k + 1]).transpose(), Block(s.H[k + 1][k + 1]);
  for (int side = 0; side < 2; ++side) {
    move(both.topRows<6>(), both.bottomRows<6>());
    both.transposeInPlace();
  }
  Block(s.H[k][k]) = both.topLeftCorner<6, 6>();
  Block(s.H[k][k + 1]) = both.topRightCorner<6, 6>();
  Block(s.H[k + 1][k + 1]) = both.bottomRightCorner<6, 6>();
  move(Columns(s.H_ck[k]), Columns(s.H_ck[k + 1]));
  move(Eigen::Map<Vec6>(s.b[k]), Eigen::Map<Vec6>(s.b[k + 1]));
  if (pace) move(Eigen::Map<Vec6>(s.H_column[kPace][k]), Eigen::Map<Vec6>(s.H_column[kPace][k + 1]));
}

/// The pace is way_m() over what it was when the velocities were held. `H_c`: its products with the calibration.
void move_pace(const Window& w, int frames, double held_m, const Eigen::Vector<double, kCameraCalibration>& H_c,
               VisualSystem& s) {
  using Block = Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>;
  using Columns = Eigen::Map<Eigen::Matrix<double, 6, kCameraCalibration>>;
  const double unit = 1 / (held_m * std::max(way_m(w, frames), kLeastPace * held_m)),
               H_pace = s.H_columns[product_of(kPace, kPace)];
  Vec6 g[kMaxFrames];  // its slope
  for (int k = 0; k < frames; ++k) {
    g[k].setZero();
    if (k > 0) g[k].head<3>() += unit * (w.at(k).x.p - w.at(k - 1).x.p);
    if (k + 1 < frames) g[k].head<3>() -= unit * (w.at(k + 1).x.p - w.at(k).x.p);
  }
  const auto h = [&](int k) { return Eigen::Map<const Vec6>(s.H_column[kPace][k]); };
  for (int k = 0; k < frames; ++k) {
    for (int l = k; l < frames; ++l)
      Block(s.H[k][l]) += h(k) * g[l].transpose() + g[k] * (h(l) + H_pace * g[l]).transpose();
    Columns(s.H_ck[k]) += g[k] * H_c.transpose();
    Eigen::Map<Vec6>(s.b[k]) += s.b_column[kPace] * g[k];
  }
}

/// Frames that hardly move until their exposure stay where their states are.
void move_to_states(const Window& w, int frames, bool pace, VisualSystem& s) {
  for (int k = frames - 2; k >= 0; --k)
    if (goes_on(w, k) && std::abs(until_exposure_s(w, k)) * velocity_of(w, k).norm() > kStays_m)
      move_to_states(w, frames, k, pace, s);
}

/// The lens' columns against all others.
void put_lens(int frames, bool asked, const double (*motion)[6][kBatchLanes], VisualSystem& s) {
  Eigen::Map<Eigen::Matrix<double, kCameraCalibration, kCameraCalibration>> H_cc(s.H_cc);
  H_cc.rightCols<kLensNumbers>().setZero();
  for (int i = 0; i < kLensNumbers; ++i) {
    const int at = kFocalColumn + i;
    for (int k = 0; k < frames; ++k) {
      Eigen::Map<Vec6> H_ck(s.H_ck[k] + 6 * at);
      if (asked)
        H_ck = Eigen::Map<const Vec6>(s.H_column[kLens + i][k]);
      else
        H_ck.setZero();
      H_cc.col(at).head<kCameraMotions>() +=
          Eigen::Map<const MotionRows>(motion[k][0]).leftCols<kCameraMotions>().transpose() * H_ck;
    }
    for (int j = 0; j <= i && asked; ++j)
      H_cc(kFocalColumn + j, at) = H_cc(at, kFocalColumn + j) = s.H_columns[product_of(kLens + i, kLens + j)];
    s.b_c[at] = asked ? s.b_column[kLens + i] : 0;
  }
  H_cc.bottomRows<kLensNumbers>() = H_cc.rightCols<kLensNumbers>().transpose().eval();
}
}  // namespace

void add_calibration(const Window& w, int frames, bool extrinsics, bool lens, const FactorKernels& kernels,
                     VisualSystem& s, double held_m) {
  alignas(64) double motion[kMaxFrames][6][kBatchLanes];
  for (int k = 0; k < frames; ++k) fill_motions(exposed_frame(w, k), extrinsics, Motions(motion[k][0]));
  kernels.calibration(motion, frames, s);
  put_lens(frames, lens, motion, s);
  const bool pace = held_m > 0;
  Eigen::Vector<double, kCameraCalibration> H_pace = Eigen::Vector<double, kCameraCalibration>::Zero();
  for (int k = 0; k < frames && pace; ++k)
    H_pace.head<kBatchLanes>() += Motions(motion[k][0]).transpose() * Eigen::Map<const Vec6>(s.H_column[kPace][k]);
  for (int i = 0; i < kLensNumbers && lens && pace; ++i)
    H_pace[kFocalColumn + i] = s.H_columns[product_of(kPace, kLens + i)];
  move_to_states(w, frames, pace, s);
  if (pace) move_pace(w, frames, held_m, H_pace, s);
}

}  // namespace epiline
