#include "estimator/solver/solver.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <cstring>
#include <limits>

#include "estimator/factors/imu.h"
#include "estimator/factors/wheel.h"

namespace epiline {

using Row3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using Row6 = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;

struct Solver::Memory {
  LinearSystem system;
  VisualSystem visual;
  alignas(64) double x_v[kMaxFrames][9][16];
  alignas(64) double x_s[kPoseDim][16];
  double expected_gain;  ///< of the solved step, were the cost quadratic
  NavState backup[kMaxFrames];
  Calibration backup_calibration;
  NewestCovariance covariance;
  Eigen::Matrix<double, kCalibration, kCalibration> calibration_covariance;
};

Solver::Solver(const Kernels& kernels) : kernels_(kernels), memory_(new Memory) {
  memory_->covariance.setZero();
  memory_->calibration_covariance.setZero();
}
Solver::~Solver() = default;

LinearSystem& Solver::system() { return memory_->system; }
const VisualSystem& Solver::visual_system() const { return memory_->visual; }
const NewestCovariance& Solver::covariance() const { return memory_->covariance; }
const Eigen::Matrix<double, kCalibration, kCalibration>& Solver::calibration_covariance() const {
  return memory_->calibration_covariance;
}

bool whiten(Slot& slot) { return square_root_information(slot.imu, slot.L_inverse) && slot.L_inverse.allFinite(); }

namespace {

bool estimated(const SolverSettings& s, int calibration) {
  return calibration == 0 ? s.estimate_time_offset : s.estimate_extrinsics;
}

void clear(LinearSystem& s, int frames) {
  s.frames = frames;
  const int dim = s.pose_dim();
  std::memset(s.S, 0, sizeof s.S[0] * static_cast<std::size_t>(dim));
  std::memset(s.P, 0, sizeof s.P[0] * static_cast<std::size_t>(frames));
  std::memset(s.D, 0, sizeof s.D[0] * static_cast<std::size_t>(frames));
  std::memset(s.C, 0, sizeof s.C[0] * static_cast<std::size_t>(frames));
  std::memset(s.rhs_s, 0, sizeof s.rhs_s);
  std::memset(s.rhs_v, 0, sizeof s.rhs_v);
}

/// A world-frame pair block turned into body tangents: delta phi = R delta theta.
Row6 to_body(const double* block, const Mat3& R_k, const Mat3& R_l) {
  const Eigen::Map<const Row6> B(block);
  Row6 T;
  T.topLeftCorner<3, 3>() = B.topLeftCorner<3, 3>();
  T.topRightCorner<3, 3>() = B.topRightCorner<3, 3>().lazyProduct(R_l);
  T.bottomLeftCorner<3, 3>() = R_k.transpose().lazyProduct(B.bottomLeftCorner<3, 3>());
  const Row3 M = R_k.transpose().lazyProduct(B.bottomRightCorner<3, 3>());
  T.bottomRightCorner<3, 3>() = M.lazyProduct(R_l);
  return T;
}

void add_visual(const Window& w, const VisualSystem& v, const SolverSettings& settings, LinearSystem& s) {
  const int n = w.size(), calibration = 6 * n;
  Mat3 R[kMaxFrames];
  for (int k = 0; k < n; ++k) R[k] = w.linearisation_point(k).R;
  for (int k = 0; k < n; ++k) {
    const int ck = pose_column(n, k);
    for (int l = k; l < n; ++l) {
      const Row6 T = to_body(v.H[k][l], R[k], R[l]);
      const int cl = pose_column(n, l);
      for (int i = 0; i < 6; ++i)
        for (int j = 0; j < 6; ++j) s.S[cl + j][ck + i] += T(i, j);
    }
    const Eigen::Map<const Vec6> b(v.b[k]);
    const Vec3 b_theta = R[k].transpose() * b.tail<3>();
    for (int i = 0; i < 3; ++i) {
      s.rhs_s[ck + i] += b[i];
      s.rhs_s[ck + 3 + i] += b_theta[i];
    }
    for (int c = 0; c < kCalibration; ++c) {
      if (!estimated(settings, c)) continue;
      const Eigen::Map<const Vec6> h(v.H_ck[k] + 6 * c);
      const Vec3 h_theta = R[k].transpose() * h.tail<3>();
      for (int i = 0; i < 3; ++i) {
        s.S[ck + i][calibration + c] += h[i];
        s.S[ck + 3 + i][calibration + c] += h_theta[i];
      }
    }
  }
  for (int c = 0; c < kCalibration; ++c) {
    if (!estimated(settings, c)) {
      s.S[calibration + c][calibration + c] += 1;  // decoupled, step zero
      continue;
    }
    s.rhs_s[calibration + c] += v.b_c[c];
    for (int d = c; d < kCalibration; ++d)
      if (estimated(settings, d)) s.S[calibration + c][calibration + d] += v.H_cc[kCalibration * c + d];
  }
}

void add_imu(const double (*A)[32], const double* g, int k, LinearSystem& s) {
  const int n = s.frames, a = k - 1, b = k, ca = pose_column(n, a), cb = pose_column(n, b);
  for (int i = 0; i < 6; ++i) {
    s.rhs_s[ca + i] += g[i];
    s.rhs_s[cb + i] += g[15 + i];
    for (int j = 0; j < 6; ++j) {
      s.S[ca + i][ca + j] += A[i][j];
      s.S[cb + i][cb + j] += A[15 + i][15 + j];
      s.S[cb + i][ca + j] += A[15 + i][j];  // the newer pose leads
    }
  }
  for (int i = 0; i < 9; ++i) {
    s.rhs_v[a][i] += g[6 + i];
    s.rhs_v[b][i] += g[21 + i];
    for (int j = 0; j < 6; ++j) {
      s.P[a][i][ca + j] += A[6 + i][j];
      s.P[a][i][cb + j] += A[6 + i][15 + j];
      s.P[b][i][ca + j] += A[21 + i][j];
      s.P[b][i][cb + j] += A[21 + i][15 + j];
    }
    for (int j = 0; j < 9; ++j) {
      s.D[a][i][j] += A[6 + i][6 + j];
      s.D[b][i][j] += A[21 + i][21 + j];
      s.C[b][i][j] += A[21 + i][6 + j];
    }
  }
}

double add_prior(const Window& w, const SolverSettings& settings, LinearSystem& s) {
  const Prior& p = w.prior;
  if (p.frames == 0) return 0;
  const int n = w.size(), np = p.frames, dim = p.dim(), rv = 6 * np, rc = p.calibration_row(), calibration = 6 * n;
  double d[kPriorDim], g[kPriorDim], cost = 0;
  prior_difference(w, d);
  for (int i = 0; i < dim; ++i) {
    double Hd = 0;
    for (int j = 0; j < dim; ++j) Hd += p.H[i][j] * d[j];
    g[i] = p.b[i] - Hd;
    cost += d[i] * (Hd - 2 * p.b[i]);
  }
  for (int k = 0; k < np; ++k) {
    const int ck = pose_column(n, k);
    for (int i = 0; i < 6; ++i) {
      s.rhs_s[ck + i] += g[6 * k + i];
      for (int l = k; l < np; ++l)
        for (int j = 0; j < 6; ++j) s.S[pose_column(n, l) + j][ck + i] += p.H[6 * k + i][6 * l + j];
      for (int c = 0; c < kCalibration; ++c)
        if (estimated(settings, c)) s.S[ck + i][calibration + c] += p.H[6 * k + i][rc + c];
      for (int j = 0; j < 9; ++j) s.P[0][j][ck + i] += p.H[rv + j][6 * k + i];
    }
  }
  for (int i = 0; i < 9; ++i) {
    s.rhs_v[0][i] += g[rv + i];
    for (int j = 0; j < 9; ++j) s.D[0][i][j] += p.H[rv + i][rv + j];
    for (int c = 0; c < kCalibration; ++c)
      if (estimated(settings, c)) s.P[0][i][calibration + c] += p.H[rv + i][rc + c];
  }
  for (int c = 0; c < kCalibration; ++c) {
    if (!estimated(settings, c)) continue;
    s.rhs_s[calibration + c] += g[rc + c];
    for (int e = c; e < kCalibration; ++e)
      if (estimated(settings, e)) s.S[calibration + c][calibration + e] += p.H[rc + c][rc + e];
  }
  return cost;
}

/// v = 0 and the position of the frame it rests with (docs/derivations/zero_motion.md).
double add_rest(const Window& w, LinearSystem& s) {
  constexpr double wv = 1 / (kRestVelocitySigma * kRestVelocitySigma),
                   wp = 1 / (kRestPositionSigma * kRestPositionSigma);
  const int n = w.size();
  double cost = 0;
  for (int k = 0; k < n; ++k) {
    const Slot& slot = w.at(k);
    if (!slot.at_rest) continue;
    cost += wv * slot.x.v.squaredNorm();
    for (int i = 0; i < 3; ++i) {
      s.rhs_v[k][i] -= wv * slot.x.v[i];
      s.D[k][i][i] += wv;
    }
    const int l = slot.rest_link ? w.index_of(slot.rest_link) : -1;
    if (l < 0) continue;
    const Vec3 d = slot.x.p - w.at(l).x.p;
    cost += wp * d.squaredNorm();
    for (int i = 0; i < 3; ++i) {
      const int a = pose_column(n, k) + i, b = pose_column(n, l) + i;  // k is newer: a < b
      s.rhs_s[a] -= wp * d[i];
      s.rhs_s[b] += wp * d[i];
      s.S[a][a] += wp;
      s.S[b][b] += wp;
      s.S[a][b] -= wp;
    }
  }
  return cost;
}

/// The speed of the wheels (docs/derivations/wheel.md).
double add_wheel(const Window& w, LinearSystem& s) {
  const int n = w.size();
  double cost = 0;
  for (int k = 0; k < n; ++k) {
    const Slot& slot = w.at(k);
    if (!slot.has_wheel) continue;
    WheelResidual f;
    evaluate_wheel(w.wheel, slot.wheel_speed_m_s, slot.omega, slot.x, w.linearisation_point(k), f);
    cost += f.cost;
    const int c = pose_column(n, k);
    for (int i = 0; i < 6; ++i) {
      s.rhs_s[c + i] -= f.weight * f.J[i] * f.r;
      for (int j = 0; j < 6; ++j) s.S[c + i][c + j] += f.weight * f.J[i] * f.J[j];
    }
    for (int i = 0; i < 9; ++i) {
      s.rhs_v[k][i] -= f.weight * f.J[6 + i] * f.r;
      for (int j = 0; j < 6; ++j) s.P[k][i][c + j] += f.weight * f.J[6 + i] * f.J[j];
      for (int j = 0; j < 9; ++j) s.D[k][i][j] += f.weight * f.J[6 + i] * f.J[6 + j];
    }
  }
  return cost;
}

}  // namespace

double imu_normal_equations(const Window& w, int k, const Kernels& kernels, double (*A)[32], double* g) {
  const Slot& slot = w.at(k);
  ImuResidual f;
  evaluate_imu(slot.imu, w.at(k - 1).x, slot.x, w.linearisation_point(k - 1), w.linearisation_point(k), f);
  alignas(64) double L[15][16] = {}, J[15][32] = {};
  for (int i = 0; i < 15; ++i) {
    for (int j = 0; j <= i; ++j) L[i][j] = slot.L_inverse(i, j);
    for (int j = 0; j < 30; ++j) J[i][j] = f.J(i, j);
  }
  return kernels.imu(L, J, f.r.data(), A, g);
}

double Solver::linearise(const Window& w, VisualFactorModel& visual, const SolverSettings& settings) {
  LinearSystem& s = memory_->system;
  clear(s, w.size());
  visual.linearise(w, memory_->visual);
  add_visual(w, memory_->visual, settings, s);
  double cost = memory_->visual.cost + add_prior(w, settings, s) + add_rest(w, s) + add_wheel(w, s);
  alignas(64) double A[30][32], g[30];
  for (int k = 1; k < w.size(); ++k) {
    cost += imu_normal_equations(w, k, kernels_, A, g);
    add_imu(A, g, k, s);
  }
  return cost;
}

/// Solves for the step in column 0 and, in the columns 1..15, for the covariance of the newest frame's state.
bool Solver::factorise_and_solve(const Window& w, double damping) {
  Memory& m = *memory_;
  LinearSystem& s = m.system;
  const int n = w.size(), dim = s.pose_dim();
  if (!kernels_.factorise(s, damping)) return false;
  std::memset(m.x_v, 0, sizeof m.x_v[0] * static_cast<std::size_t>(n));
  std::memset(m.x_s, 0, sizeof m.x_s[0] * static_cast<std::size_t>(dim));
  for (int k = 0; k < n; ++k)
    for (int i = 0; i < 9; ++i) m.x_v[k][i][0] = s.rhs_v[k][i];
  for (int i = 0; i < dim; ++i) m.x_s[i][0] = s.rhs_s[i];
  for (int i = 0; i < 6; ++i) m.x_s[i][1 + i] = 1;
  for (int i = 0; i < 9; ++i) m.x_v[n - 1][i][7 + i] = 1;
  kernels_.solve(s, m.x_v, m.x_s);
  m.expected_gain = 0;
  for (int i = 0; i < dim; ++i) m.expected_gain += m.x_s[i][0] * s.rhs_s[i];
  for (int k = 0; k < n; ++k)
    for (int i = 0; i < 9; ++i) m.expected_gain += m.x_v[k][i][0] * s.rhs_v[k][i];
  return true;
}

/// Applies the solved step. False: it is not finite.
bool Solver::apply_step(Window& w, VisualFactorModel& visual, const SolverSettings& settings) {
  const Memory& m = *memory_;
  const int n = w.size();
  double sum = 0;
  for (int k = 0; k < n; ++k) {
    Vec6 dp;
    Vec9 dv;
    for (int i = 0; i < 6; ++i) dp[i] = m.x_s[pose_column(n, k) + i][0];
    for (int i = 0; i < 9; ++i) dv[i] = m.x_v[k][i][0];
    sum += dp.squaredNorm() + dv.squaredNorm();
    NavState& x = w.at(k).x;
    retract_pose(x, dp);
    x.R = so3_normalised(x.R);
    retract_velocity_biases(x, dv);
  }
  CalibrationTangent dc;
  for (int c = 0; c < kCalibration; ++c) dc[c] = estimated(settings, c) ? m.x_s[6 * n + c][0] : 0;
  retract(w.calibration, dc);
  visual.step(w);
  return std::isfinite(sum + dc.sum());
}

void Solver::read_covariance(const Window& w, const SolverSettings& settings) {
  Memory& m = *memory_;
  const int n = w.size();
  // the calibration block is last in the elimination: its covariance is U^-1 U^-T of the trailing block alone
  Eigen::Matrix<double, kCalibration, kCalibration> U = Eigen::Matrix<double, kCalibration, kCalibration>::Zero();
  for (int i = 0; i < kCalibration; ++i)
    for (int j = i; j < kCalibration; ++j) U(i, j) = m.system.S[6 * n + i][6 * n + j];
  Eigen::Matrix<double, kCalibration, kCalibration> V = Eigen::Matrix<double, kCalibration, kCalibration>::Identity();
  U.triangularView<Eigen::Upper>().solveInPlace(V);
  m.calibration_covariance.noalias() = V.lazyProduct(V.transpose());
  for (int c = 0; c < kCalibration; ++c)
    if (!estimated(settings, c)) {
      m.calibration_covariance.row(c).setZero();
      m.calibration_covariance.col(c).setZero();
    }
  for (int j = 0; j < 15; ++j) {
    for (int i = 0; i < 6; ++i) m.covariance(i, j) = m.x_s[i][1 + j];
    for (int i = 0; i < 9; ++i) m.covariance(6 + i, j) = m.x_v[n - 1][i][1 + j];
    m.covariance(15, j) = m.covariance(j, 15) = settings.estimate_time_offset ? m.x_s[6 * n][1 + j] : 0;
  }
  m.covariance(15, 15) = m.calibration_covariance(0, 0);
}

SolverSummary Solver::optimise(Window& w, VisualFactorModel& visual, const SolverSettings& settings,
                               Supervisor& supervisor) {
  // No damping at first: relative to the information of an IMU interval (1e9 1/m^2) even 1e-9 would pin down the
  // position to a few decimetres, which vision and IMU cannot know.
  constexpr double kFirstDamping = 0, kAfterRejection = 1e-4, kNoGain = 1e-3;
  constexpr double kInsignificant = 0.05;  // of an unknown's variance
  constexpr int kMaxRejections = 4;
  SolverSummary r;
  double damping = kFirstDamping, cost = r.cost_first = linearise(w, visual, settings);
  r.linearisations = 1;
  bool covariance_fresh = false, linearised_here = true;
  while (r.accepted < settings.steps) {
    if (r.accepted > 0 && supervisor.time_is_up()) {
      r.out_of_time = true;
      break;
    }
    save(w, visual);
    double trial = std::numeric_limits<double>::infinity();
    if (factorise_and_solve(w, damping)) {
      covariance_fresh = damping == kFirstDamping;
      if (covariance_fresh) read_covariance(w, settings);
      if (apply_step(w, visual, settings)) {
        trial = settings.tried ? linearise(w, visual, settings) : cost;
        r.linearisations += settings.tried ? 1 : 0;
      }
    }
    if (trial <= cost * (1 + 1e-6) + 1e-6) {
      ++r.accepted;
      const double gain = cost - trial;
      cost = trial;
      linearised_here = true;
      damping = std::max(damping * 0.1, kFirstDamping);
      if (r.accepted >= 2 && gain < kNoGain * std::abs(cost) + kNoGain) break;
      continue;
    }
    restore(w, visual);
    linearised_here = false;
    // As good as converged: the window is where it was. Without parallax the depths jump and the cost with them; there
    // the quadratic model tells when a step is far below what is known of the state.
    if (trial < cost * (1 + kNoGain) + kNoGain) break;
    if (std::isfinite(trial) && memory_->expected_gain < kInsignificant * 15 * w.size()) break;
    r.out_of_time = supervisor.time_is_up();
    ++r.rejected;
    r.unimproved = r.accepted == 0 && r.rejected < kMaxRejections && (r.out_of_time || r.rejected >= settings.attempts);
    if (r.unimproved || r.out_of_time || r.rejected >= std::min(settings.attempts, kMaxRejections)) break;
    damping = std::max(damping * 30, kAfterRejection);
    linearise(w, visual, settings);
    ++r.linearisations;
    linearised_here = true;
  }
  if (!covariance_fresh) {  // the last factors were damped, which would flatter it
    if (!linearised_here) linearise(w, visual, settings);
    if (factorise_and_solve(w, kFirstDamping)) read_covariance(w, settings);
  }
  r.cost = cost;
  r.ok = r.rejected < kMaxRejections && std::isfinite(cost);
  r.residuals = memory_->visual.residuals;
  r.tracks = memory_->visual.tracks;
  r.gated = memory_->visual.gated;
  return r;
}

void Solver::save(const Window& w, VisualFactorModel& visual) {
  for (int k = 0; k < w.size(); ++k) memory_->backup[k] = w.at(k).x;
  memory_->backup_calibration = w.calibration;
  visual.save();
}

void Solver::restore(Window& w, VisualFactorModel& visual) {
  for (int k = 0; k < w.size(); ++k) w.at(k).x = memory_->backup[k];
  w.calibration = memory_->backup_calibration;
  visual.restore();
}

}  // namespace epiline
