#include "estimator/initialise/gyroscope_bias.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "estimator/geometry/so3.h"
#include "estimator/initialise/start_path.h"

namespace epiline {
namespace {

constexpr int kFewest = 15;  // common tracks a pair needs
// One iteration each; in sigmas. A wide kernel pulls from afar, the last one forgets gross errors.
constexpr std::array<double, 6> kKernel = {64, 16, 8, 4, 2, 2};

/// Bearings of the tracks two frames share, in their own body frames.
struct Pair {
  int n = 0;
  std::array<Vec3, kStartTracks> a, b;
};

int view_of(const StartTrack& t, int frame) {
  for (int q = 0; q < t.count; ++q)
    if (t.frame[q] == frame) return q;
  return -1;
}

void gather(const StartProblem& problem, int i, int j, Pair& pair) {
  pair.n = 0;
  for (const StartTrack& t : problem.tracks) {
    if (pair.n == kStartTracks) break;
    const int a = view_of(t, i), b = view_of(t, j);
    if (a < 0 || b < 0) continue;
    pair.a[pair.n] = problem.R_BC * t.f_C[a];
    pair.b[pair.n++] = problem.R_BC * t.f_C[b];
  }
}

/// Variance of x . (a x Rb) for bearing noise sigma; `Rb` = R b. The floor keeps bearings along x finite.
double variance(const Vec3& a, const Vec3& Rb, const Vec3& x, double sigma) {
  return sigma * sigma * (Rb.cross(x).squaredNorm() + a.cross(x).squaredNorm() + 1e-6);
}

/// The direction of translation: the robust null vector of the coplanarity normals.
Vec3 translation_direction(const Pair& pair, const Mat3& R, double sigma, double kernel2) {
  Mat3 M = Mat3::Zero();
  for (int s = 0; s < pair.n; ++s) {
    const Vec3 n = pair.a[s].cross(R * pair.b[s]);
    M += n * n.transpose();
  }
  Vec3 x;
  for (int round = 0; round < 2; ++round) {
    const Eigen::SelfAdjointEigenSolver<Mat3> eigen(M);
    x = eigen.eigenvectors().col(0);
    M.setZero();
    for (int s = 0; s < pair.n; ++s) {
      const Vec3 Rb = R * pair.b[s], n = pair.a[s].cross(Rb);
      const double v = variance(pair.a[s], Rb, x, sigma), e = n.dot(x);
      M += n * n.transpose() / (v * (1 + e * e / (v * kernel2)));
    }
  }
  return x;
}

/// Adds one pair's normal equations in b_g; the two degrees of freedom of the direction are projected out.
/// J: right perturbation of R by b_g.
void add_pair(const Pair& pair, const Mat3& R, const Mat3& J, double sigma, double kernel2, Mat3& H, Vec3& g) {
  const Vec3 x = translation_direction(pair, R, sigma, kernel2);
  Eigen::Matrix<double, 3, 2> T;
  T.col(0) = x.unitOrthogonal();
  T.col(1) = x.cross(T.col(0));
  Mat3 Hb = Mat3::Zero();
  Vec3 gb = Vec3::Zero();
  Eigen::Matrix2d K = 1e-6 * Eigen::Matrix2d::Identity();
  Eigen::Matrix<double, 2, 3> X = Eigen::Matrix<double, 2, 3>::Zero();
  Vec2 k = Vec2::Zero();
  for (int s = 0; s < pair.n; ++s) {
    const Vec3 Rb = R * pair.b[s], n = pair.a[s].cross(Rb);
    const double scale = 1 / std::sqrt(variance(pair.a[s], Rb, x, sigma));
    const double e = scale * n.dot(x), w = 1 / (1 + e * e / kernel2);
    // d(R b) = -R [b]x J db
    const Vec3 row = scale * (J.transpose() * (pair.b[s].cross(R.transpose() * x.cross(pair.a[s]))));
    const Vec2 free = scale * (T.transpose() * n);
    Hb += w * row * row.transpose();
    gb -= w * e * row;
    K += w * free * free.transpose();
    X += w * free * row.transpose();
    k -= w * e * free;
  }
  const Eigen::Matrix2d K_inverse = K.inverse();
  H += Hb - X.transpose() * K_inverse * X;
  g += gb - X.transpose() * K_inverse * k;
}

}  // namespace

bool solve_gyroscope_bias(const StartProblem& problem, Vec3& b_g) {
  const int last = problem.frames - 1;
  const double information = 1 / (problem.b_g_sigma * problem.b_g_sigma);
  Vec3 b = b_g;
  Pair pair;
  StartPath path;
  for (const double kernel : kKernel) {
    chain(problem, b, Vec3::Zero(), path);
    Mat3 H = information * Mat3::Identity();
    Vec3 g = information * (problem.b_g_ref - b);
    int pairs = 0;
    for (const int span : {std::max(1, last / 4), std::max(1, last / 2), last}) {
      for (int i = 0; i + span <= last; i += std::max(1, span / 2)) {
        const int j = i + span;
        gather(problem, i, j, pair);
        if (pair.n < kFewest) continue;
        ++pairs;
        const Mat3 R = path[i].R.transpose() * path[j].R;
        add_pair(pair, R, path[j].theta_b - R.transpose() * path[i].theta_b, problem.sigma_rad, kernel * kernel, H, g);
      }
    }
    if (pairs < 3) return false;
    const Vec3 step = H.ldlt().solve(g);
    if (!step.allFinite()) return false;
    b += step;
  }
  b_g = b;
  return true;
}

}  // namespace epiline
