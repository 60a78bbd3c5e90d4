#include "estimator/window/marginalise.h"

#include <cstring>

#include "estimator/factors/wheel.h"
#include "estimator/solver/solver.h"

namespace epiline {

// Unknowns: pose and (v, b) of frame 0, which go; then poses 1..m-1, (v, b) of frame 1 and the calibration, which stay.
struct Marginaliser::Memory {
  VisualSystem visual;
  alignas(64) double A[kMarginalDim][kMarginalStride];
  double b[kMarginalDim];
};

Marginaliser::Marginaliser(const Kernels& kernels) : kernels_(kernels), memory_(new Memory) {}
Marginaliser::~Marginaliser() = default;

namespace {

/// Where a frame's unknowns stand when the frames 0..m-1 take part.
struct Layout {
  int m;
  int pose(int k) const { return k == 0 ? 0 : 15 + 6 * (k - 1); }
  int velocity(int k) const { return k == 0 ? 6 : 15 + 6 * (m - 1); }  // frames 0 and 1 only
  int calibration() const { return velocity(1) + 9; }
  int total() const { return calibration() + kCalibration; }
};

using Matrix = double (*)[kMarginalStride];

/// Adds to the upper triangle wherever (i, j) falls.
void add(Matrix A, int i, int j, double x) {
  if (i <= j)
    A[i][j] += x;
  else
    A[j][i] += x;
}

void add_visual(const Window& w, const VisualSystem& v, const Layout& at, Matrix A, double* b) {
  Mat3 R[kMaxFrames];
  for (int k = 0; k < at.m; ++k) R[k] = w.linearisation_point(k).R;
  using Row6 = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;
  for (int k = 0; k < at.m; ++k) {
    Eigen::Matrix<double, 6, 6> Tk = Eigen::Matrix<double, 6, 6>::Identity();
    Tk.bottomRightCorner<3, 3>() = R[k];
    for (int l = k; l < at.m; ++l) {
      Eigen::Matrix<double, 6, 6> Tl = Eigen::Matrix<double, 6, 6>::Identity();
      Tl.bottomRightCorner<3, 3>() = R[l];
      const Row6 block = Eigen::Map<const Row6>(v.H[k][l]);
      const Row6 half = Tk.transpose().lazyProduct(block);
      const Row6 H = half.lazyProduct(Tl);
      for (int i = 0; i < 6; ++i)
        for (int j = k == l ? i : 0; j < 6; ++j) add(A, at.pose(k) + i, at.pose(l) + j, H(i, j));
    }
    const Vec6 bk = Tk.transpose().lazyProduct(Eigen::Map<const Vec6>(v.b[k]));
    for (int i = 0; i < 6; ++i) b[at.pose(k) + i] += bk[i];
    for (int c = 0; c < kCalibration; ++c) {
      const Vec6 h = Tk.transpose().lazyProduct(Eigen::Map<const Vec6>(v.H_ck[k] + 6 * c));
      for (int i = 0; i < 6; ++i) add(A, at.pose(k) + i, at.calibration() + c, h[i]);
    }
  }
  for (int c = 0; c < kCalibration; ++c) {
    b[at.calibration() + c] += v.b_c[c];
    for (int d = c; d < kCalibration; ++d)
      A[at.calibration() + c][at.calibration() + d] += v.H_cc[kCalibration * c + d];
  }
}

void add_prior(const Window& w, const Layout& at, Matrix A, double* b) {
  const Prior& p = w.prior;
  if (p.frames == 0) return;
  int where[kPriorDim];
  for (int k = 0; k < p.frames; ++k)
    for (int i = 0; i < 6; ++i) where[6 * k + i] = at.pose(k) + i;
  for (int i = 0; i < 9; ++i) where[6 * p.frames + i] = at.velocity(0) + i;
  for (int c = 0; c < kCalibration; ++c) where[p.calibration_row() + c] = at.calibration() + c;
  double d[kPriorDim];
  prior_difference(w, d);
  const int dim = p.dim();
  for (int i = 0; i < dim; ++i) {
    double g = p.b[i];
    for (int j = 0; j < dim; ++j) g -= p.H[i][j] * d[j];
    b[where[i]] += g;
    for (int j = i; j < dim; ++j) add(A, where[i], where[j], p.H[i][j]);
  }
}

void add_imu(const Window& w, const Kernels& kernels, const Layout& at, Matrix A, double* b) {
  alignas(64) double H[30][32], g[30];
  imu_normal_equations(w, 1, kernels, H, g);
  int where[30];
  for (int f = 0; f < 2; ++f) {
    for (int i = 0; i < 6; ++i) where[15 * f + i] = at.pose(f) + i;
    for (int i = 0; i < 9; ++i) where[15 * f + 6 + i] = at.velocity(f) + i;
  }
  for (int i = 0; i < 30; ++i) {
    b[where[i]] += g[i];
    for (int j = i; j < 30; ++j) add(A, where[i], where[j], H[i][j]);
  }
}

void add_rest(const Window& w, const Layout& at, Matrix A, double* b) {
  constexpr double wv = 1 / (kRestVelocitySigma * kRestVelocitySigma),
                   wp = 1 / (kRestPositionSigma * kRestPositionSigma);
  const Slot& oldest = w.at(0);
  if (oldest.at_rest)
    for (int i = 0; i < 3; ++i) {
      A[at.velocity(0) + i][at.velocity(0) + i] += wv;
      b[at.velocity(0) + i] -= wv * oldest.x.v[i];
    }
  for (int k = 1; k < at.m; ++k) {
    if (!w.at(k).at_rest || w.at(k).rest_link != oldest.id) continue;
    const Vec3 d = w.at(k).x.p - oldest.x.p;
    for (int i = 0; i < 3; ++i) {
      const int a = at.pose(0) + i, c = at.pose(k) + i;
      b[c] -= wp * d[i];
      b[a] += wp * d[i];
      A[a][a] += wp;
      A[c][c] += wp;
      A[a][c] -= wp;
    }
  }
}

void add_wheel(const Window& w, const Layout& at, Matrix A, double* b) {
  const Slot& oldest = w.at(0);
  if (!oldest.has_wheel) return;
  WheelResidual f;
  evaluate_wheel(w.wheel, oldest.wheel_speed_m_s, oldest.omega, oldest.x, w.linearisation_point(0), f);
  const auto where = [&](int i) { return i < 6 ? at.pose(0) + i : at.velocity(0) + i - 6; };
  for (int i = 0; i < 15; ++i) {
    b[where(i)] -= f.weight * f.J[i] * f.r;
    for (int j = i; j < 15; ++j) add(A, where(i), where(j), f.weight * f.J[i] * f.J[j]);
  }
}

void store_prior(Window& w, const Layout& at, const Matrix A, const double* b) {
  Prior& p = w.prior;
  p.frames = at.m - 1;
  const int dim = p.dim();
  for (int i = 0; i < dim; ++i) {
    p.b[i] = b[15 + i];
    for (int j = i; j < dim; ++j) p.H[i][j] = p.H[j][i] = A[15 + i][15 + j];
  }
  for (int k = 0; k < p.frames; ++k) p.x0[static_cast<std::size_t>(k)] = w.at(k + 1).x;
  p.c0 = w.calibration;
}

void freeze_first_estimates(Window& w, int m) {
  for (int k = 1; k < m; ++k) {
    Slot& s = w.at(k);
    if (!s.has_first) s.first = s.x;
    s.has_first = true;
  }
  w.at(1).first.v = w.at(1).x.v;
}

}  // namespace

void Marginaliser::marginalise_oldest(Window& w, VisualFactorModel& visual, const VisualSettings& settings) {
  const Layout at{visual.prior_reaches_newest() ? w.size() : w.size() - 1};
  Matrix A = memory_->A;
  double* b = memory_->b;
  std::memset(A, 0, sizeof A[0] * static_cast<std::size_t>(at.total()));
  std::memset(b, 0, sizeof b[0] * static_cast<std::size_t>(at.total()));
  visual.marginalise_oldest(w, settings, memory_->visual);
  add_visual(w, memory_->visual, at, A, b);
  add_prior(w, at, A, b);
  add_imu(w, kernels_, at, A, b);
  add_rest(w, at, A, b);
  add_wheel(w, at, A, b);
  kernels_.eliminate(A[0], b, 15, at.total());
  store_prior(w, at, A, b);
  freeze_first_estimates(w, at.m);
  for (int k = 1; k < w.size(); ++k)
    if (w.at(k).rest_link == w.at(0).id) w.at(k).rest_link = 0;
  w.remove(0);
}

void Marginaliser::forget_pose(Window& w, int k) {
  Prior& p = w.prior;
  if (k >= p.frames) return;
  Matrix A = memory_->A;
  double* b = memory_->b;
  const int dim = p.dim();
  int where[kPriorDim];  // the pose first, the others in their order
  for (int i = 0; i < dim; ++i) where[i] = i < 6 * k ? i + 6 : i < 6 * k + 6 ? i - 6 * k : i;
  double d[kPriorDim];
  prior_difference(w, d);
  for (int i = 0; i < dim; ++i) {
    double g = p.b[i];
    for (int j = 0; j < dim; ++j) {
      g -= p.H[i][j] * d[j];
      if (where[j] >= where[i]) A[where[i]][where[j]] = p.H[i][j];
    }
    b[where[i]] = g;
  }
  kernels_.eliminate(A[0], b, 6, dim);
  --p.frames;
  for (int i = 0; i < p.dim(); ++i) {
    p.b[i] = b[6 + i];
    for (int j = i; j < p.dim(); ++j) p.H[i][j] = p.H[j][i] = A[6 + i][6 + j];
  }
  for (int l = 0; l < p.frames; ++l) p.x0[static_cast<std::size_t>(l)] = w.at(l < k ? l : l + 1).x;
  p.c0 = w.calibration;
}

void inflate_calibration(Prior& p, int parameter, double variance) {
  if (p.frames == 0 || variance <= 0) return;
  const int e = p.calibration_row() + parameter, dim = p.dim();
  // (H^-1 + q e e')^-1 = H - H e e' H q / (1 + q H_ee); the mean H^-1 b stays
  const double gain = variance / (1 + variance * p.H[e][e]);
  double column[kPriorDim];
  for (int i = 0; i < dim; ++i) column[i] = p.H[i][e];
  const double b_e = p.b[e];
  for (int i = 0; i < dim; ++i) {
    p.b[i] -= gain * column[i] * b_e;
    for (int j = 0; j < dim; ++j) p.H[i][j] -= gain * column[i] * column[j];
  }
}

void set_initial_prior(Window& w, const InitialState& s, const CalibrationTangent& calibration_sigmas) {
  Prior& p = w.prior;
  p.frames = 1;
  const int dim = p.dim();
  for (int i = 0; i < dim; ++i) {
    std::memset(p.H[i], 0, sizeof p.H[i]);
    p.b[i] = 0;
  }
  auto information = [](double sigma) { return 1 / (sigma * sigma); };
  const NavState& x = w.at(0).x;
  // tilt and yaw are errors in the world; the tangent is in the body
  const Vec3 world(information(s.sigma_tilt), information(s.sigma_tilt), information(s.sigma_yaw));
  const Mat3 attitude = x.R.transpose() * world.asDiagonal() * x.R;
  for (int i = 0; i < 3; ++i) {
    p.H[i][i] = information(s.sigma_p);
    for (int j = 0; j < 3; ++j) p.H[3 + i][3 + j] = attitude(i, j);
    p.H[6 + i][6 + i] = information(s.sigma_v);
    p.H[9 + i][9 + i] = information(s.sigma_b_a);
    p.H[12 + i][12 + i] = information(s.sigma_b_g);
  }
  for (int c = 0; c < kCalibration; ++c)
    p.H[15 + c][15 + c] = calibration_sigmas[c] > 0 ? information(calibration_sigmas[c]) : 0;
  p.x0[0] = x;
  p.c0 = w.calibration;
}

}  // namespace epiline
