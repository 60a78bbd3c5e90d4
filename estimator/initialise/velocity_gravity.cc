#include "estimator/initialise/velocity_gravity.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "estimator/geometry/so3.h"

namespace epiline {
namespace {

using Vec6 = Eigen::Matrix<double, 6, 1>;
using Mat6 = Eigen::Matrix<double, 6, 6>;
using Mat36 = Eigen::Matrix<double, 3, 6>;

constexpr int kPasses = 2;

/// Camera centre c_k = L_k (v_0, g_0) + s_k.
struct Centre {
  Mat36 L;
  Vec3 s;
};

struct Rays {
  std::array<Vec3, kStartFrames> f;  ///< unit, in B_0
  int i = 0, j = 0;                  ///< base views: the widest angle
  double sin2 = 0;                   ///< of that angle
};

Rays rays(const StartProblem& problem, const StartPath& path, const StartTrack& track) {
  Rays r;
  for (int q = 0; q < track.count; ++q) r.f[q] = path[track.frame[q]].R * (problem.R_BC * track.f_C[q]);
  for (int i = 0; i < track.count; ++i)
    for (int j = i + 1; j < track.count; ++j) {
      const double s = r.f[j].cross(r.f[i]).squaredNorm();
      if (s > r.sin2) r.i = i, r.j = j, r.sin2 = s;
    }
  return r;
}

/// min x'Ax - 2b'x with |g| = kGravity, x = (v, g): v is eliminated, then the secular equation in one multiplier is
/// solved.
bool solve_constrained(const Mat6& A, const Vec6& b, Vec6& x) {
  const Eigen::LDLT<Mat3> vv(A.topLeftCorner<3, 3>());
  if (vv.info() != Eigen::Success || !(vv.vectorD().minCoeff() > 0)) return false;
  const Mat3 vg = A.topRightCorner<3, 3>();
  const Mat3 S = A.bottomRightCorner<3, 3>() - vg.transpose() * vv.solve(vg);
  const Vec3 r = b.tail<3>() - vg.transpose() * vv.solve(b.head<3>());
  const Eigen::SelfAdjointEigenSolver<Mat3> eigen(0.5 * (S + S.transpose()));
  const Vec3& e = eigen.eigenvalues();
  const Vec3 q = eigen.eigenvectors().transpose() * r;
  // |g(mu)| falls from infinity to 0 between mu = -e_min and these bounds; the global minimum is its only crossing.
  double low = -e[0], high = -e[0] + q.norm() / kGravity;
  const auto g_at = [&](double mu) { return Vec3(q.array() / (e.array() + mu)); };
  for (int n = 0; n < 60; ++n) {
    const double mu = 0.5 * (low + high);
    (g_at(mu).norm() > kGravity ? low : high) = mu;
  }
  const Vec3 g = eigen.eigenvectors() * g_at(high);
  if (!g.allFinite() || g.norm() < 0.5 * kGravity) return false;
  x.tail<3>() = g.normalized() * kGravity;
  x.head<3>() = vv.solve(b.head<3>() - vg * x.tail<3>());
  return x.allFinite();
}

struct Normal {
  Mat6 A = Mat6::Zero();
  Vec6 b = Vec6::Zero();
};

/// The rows [f_k]x (f_i a'(c_i - c_j) + sin^2 (c_i - c_k)) = 0 of one track, each divided by its noise at `x` (first
/// pass: unknown).
void add_track(const StartTrack& track, const Rays& r, const std::array<Centre, kStartFrames>& centre, double sigma,
               const Vec6* x, Normal& n) {
  const Centre &ci = centre[track.frame[r.i]], &cj = centre[track.frame[r.j]];
  const Vec3 a = -(skew(r.f[r.j]).transpose() * r.f[r.j].cross(r.f[r.i]));
  for (int k = 0; k < track.count; ++k) {
    if (k == r.i) continue;
    const Centre& ck = centre[track.frame[k]];
    const Mat3 F = skew(r.f[k]);
    const Mat3 D = F * r.f[r.i] * a.transpose();
    const Mat36 row = D * (ci.L - cj.L) + r.sin2 * F * (ci.L - ck.L);
    const Vec3 rhs = -(D * (ci.s - cj.s) + r.sin2 * F * (ci.s - ck.s));
    double w = 1 / std::sqrt(r.sin2);
    if (x != nullptr) {
      const double depth = std::abs(a.dot((ci.L - cj.L) * *x + ci.s - cj.s)) / r.sin2;
      const double distance = std::max(0.3, (depth * r.f[r.i] + (ci.L - ck.L) * *x + ci.s - ck.s).norm());
      w = 1 / (r.sin2 * distance * sigma);
      w /= std::sqrt(1 + (w * (row * *x - rhs)).squaredNorm() / 9);
    }
    n.A += (w * w) * row.transpose() * row;
    n.b += (w * w) * row.transpose() * rhs;
  }
}

}  // namespace

bool solve_velocity_gravity(const StartProblem& problem, const StartPath& path, StartState& state) {
  std::array<Centre, kStartFrames> centre;
  for (int k = 0; k < problem.frames; ++k) {
    const double T = path[k].T;
    centre[k].L << Mat3::Identity() * T, Mat3::Identity() * (0.5 * T * T);
    centre[k].s = path[k].alpha + path[k].R * problem.p_BC;
  }
  Vec6 x;
  const int tracks = std::min<int>(kStartTracks, static_cast<int>(problem.tracks.size()));
  const double smallest = 4 * problem.sigma_rad;  // below it the base pair's depth is noise
  for (int pass = 0; pass < kPasses; ++pass) {
    Normal n;
    int used = 0;
    for (int t = 0; t < tracks; ++t) {
      const StartTrack& track = problem.tracks[t];
      if (track.count < 3) continue;
      const Rays r = rays(problem, path, track);
      if (r.sin2 < smallest * smallest) continue;
      ++used;
      add_track(track, r, centre, problem.sigma_rad, pass == 0 ? nullptr : &x, n);
    }
    if (used < 4 || !solve_constrained(n.A, n.b, x)) return false;
  }
  state.v_0 = x.head<3>();
  state.g_0 = x.tail<3>();
  return true;
}

}  // namespace epiline
