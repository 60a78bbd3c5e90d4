#include "estimator/initialise/velocity_gravity.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace epiline {
namespace {

using Vec6 = Eigen::Matrix<double, 6, 1>;
using Mat6 = Eigen::Matrix<double, 6, 6>;

constexpr int kPasses = 2;

/// Camera centre c_k = T v_0 + h g_0 + s.
struct Centre {
  double T, h;
  Vec3 s, at;  ///< `at`: the centre where v_0 and g_0 were found by the pass before
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

/// The rows [f_k]x (f_i a'(c_i - c_j) + sin^2 (c_i - c_k)) = 0 of one track, each divided by its noise at the centres
/// found (first pass: unknown). They are u a' times what i and j have in common, and [f_k]x times what is k's own, with
/// u = f_k x f_i; so few sums give their products.
void add_track(const StartTrack& track, const Rays& r, const std::array<Centre, kStartFrames>& centre, double sigma,
               bool found, Normal& n) {
  const Centre &ci = centre[track.frame[r.i]], &cj = centre[track.frame[r.j]];
  const Vec3 a = r.f[r.j].cross(r.f[r.j].cross(r.f[r.i]));
  const double T = ci.T - cj.T, h = ci.h - cj.h, base = a.dot(ci.s - cj.s), base_at = a.dot(ci.at - cj.at);
  double uu = 0, ur = 0;
  Vec3 v_T = Vec3::Zero(), v_h = Vec3::Zero();
  Mat3 TT = Mat3::Zero(), Th = Mat3::Zero(), hh = Mat3::Zero();
  for (int k = 0; k < track.count; ++k) {
    if (k == r.i) continue;
    const Centre& ck = centre[track.frame[k]];
    const Vec3& f = r.f[k];
    const Vec3 u = f.cross(r.f[r.i]);
    double w2 = 1 / r.sin2;
    if (found) {
      const Vec3 d = ci.at - ck.at;
      const double distance = std::max(0.3, (std::abs(base_at) / r.sin2 * r.f[r.i] + d).norm());
      const double w = 1 / (r.sin2 * distance * sigma);
      w2 = w * w / (1 + w * w * (base_at * u + r.sin2 * f.cross(d)).squaredNorm() / 9);
    }
    const double T_k = r.sin2 * (ci.T - ck.T), h_k = r.sin2 * (ci.h - ck.h);
    const Vec3 v = w2 * u.cross(f), rhs = -w2 * (base * u + r.sin2 * f.cross(ci.s - ck.s)), own = rhs.cross(f);
    const Mat3 tangent = w2 * (Mat3::Identity() - f * f.transpose());
    uu += w2 * u.squaredNorm();
    ur += u.dot(rhs);
    v_T += T_k * v;
    v_h += h_k * v;
    TT += (T_k * T_k) * tangent;
    Th += (T_k * h_k) * tangent;
    hh += (h_k * h_k) * tangent;
    n.b.head<3>() += T_k * own;
    n.b.tail<3>() += h_k * own;
  }
  const Mat3 aa = uu * a * a.transpose(), a_T = a * v_T.transpose(), a_h = a * v_h.transpose();
  n.A.topLeftCorner<3, 3>() += T * T * aa + T * (a_T + a_T.transpose()) + TT;
  n.A.topRightCorner<3, 3>() += T * h * aa + T * a_h + h * a_T.transpose() + Th;
  n.A.bottomRightCorner<3, 3>() += h * h * aa + h * (a_h + a_h.transpose()) + hh;
  n.b.head<3>() += T * ur * a;
  n.b.tail<3>() += h * ur * a;
}

}  // namespace

bool solve_velocity_gravity(const StartProblem& problem, const StartPath& path, StartState& state) {
  std::array<Centre, kStartFrames> centre;
  for (int k = 0; k < problem.frames; ++k) {
    const double T = path[k].T;
    centre[k] = {T, 0.5 * T * T, path[k].alpha + path[k].R * problem.p_BC, Vec3::Zero()};
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
      add_track(track, r, centre, problem.sigma_rad, pass > 0, n);
    }
    if (used < 4 || !solve_constrained(n.A, n.b, x)) return false;
    for (int k = 0; k < problem.frames; ++k)
      centre[k].at = centre[k].T * x.head<3>() + centre[k].h * x.tail<3>() + centre[k].s;
  }
  state.v_0 = x.head<3>();
  state.g_0 = x.tail<3>();
  return true;
}

}  // namespace epiline
