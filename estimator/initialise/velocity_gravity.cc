#include "estimator/initialise/velocity_gravity.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <cmath>

namespace epiline {
namespace {

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

bool solve(const StartLinear& system, Vec6& x) {
  Mat6 A;
  A.topLeftCorner<3, 3>() = Eigen::Map<const RowMat3>(system.vv);
  A.topRightCorner<3, 3>() = Eigen::Map<const RowMat3>(system.vg);
  A.bottomRightCorner<3, 3>() = Eigen::Map<const RowMat3>(system.gg);
  Vec6 b;
  b << Eigen::Map<const Vec3>(system.v), Eigen::Map<const Vec3>(system.g);
  return solve_constrained(A, b, x);
}

}  // namespace

/// The second pass knows where the first put the centres, and so how far each row's noise reaches.
bool solve_velocity_gravity(const StartProblem& problem, const PointElimination& points, const StartPath& path,
                            StartState& state) {
  StartCameras camera;
  place_cameras(problem, path, {.v_0 = Vec3::Zero(), .g_0 = Vec3::Zero()}, camera);
  const double smallest = 4 * problem.sigma_rad;  // below it the base pair's depth is noise
  std::array<double[3], kStartFrames> at;
  Vec6 x;
  for (const bool found : {false, true}) {
    const StartLinear system =
        points.linear(camera, smallest * smallest, problem.sigma_rad, found ? at.data() : nullptr);
    if (system.tracks < 4 || !solve(system, x)) return false;
    for (int k = 0; k < problem.frames; ++k)
      Eigen::Map<Vec3>{at[k]} =
          camera[k].T * x.head<3>() + camera[k].half_T2 * x.tail<3>() + Eigen::Map<Vec3>(camera[k].c);
  }
  state.v_0 = x.head<3>();
  state.g_0 = x.tail<3>();
  return true;
}

}  // namespace epiline
