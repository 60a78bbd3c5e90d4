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
constexpr int kMost = 64;    // of a pair's tracks are enough to begin from
constexpr int kPairs = 13;   // of frames, see gather_all()
// One iteration each; in sigmas. A wide kernel pulls from afar, the last one forgets gross errors.
constexpr std::array<double, 6> kKernel = {64, 16, 8, 4, 2, 2};
constexpr double kAnew = 8;  // with a kernel this wide the direction is sought without regard to the last one

/// Bearings of the tracks two frames share, in their own body frames.
struct Pair {
  int i = 0, j = 0, n = 0;
  std::array<Vec3, kMost> a, b;
  Vec3 direction = Vec3::Zero();  ///< of the translation, as found last; zero: unknown
};

int view_of(const StartTrack& t, int frame) {
  for (int q = 0; q < t.count; ++q)
    if (t.frame[q] == frame) return q;
  return -1;
}

/// False: too few.
bool gather(const StartProblem& problem, int i, int j, Pair& pair) {
  std::array<std::uint16_t, kStartTracks> shared;
  int count = 0;
  const int tracks = std::min<int>(kStartTracks, static_cast<int>(problem.tracks.size()));
  for (int t = 0; t < tracks; ++t) {
    const StartTrack& track = problem.tracks[static_cast<std::size_t>(t)];
    if (view_of(track, i) >= 0 && view_of(track, j) >= 0)
      shared[static_cast<std::size_t>(count++)] = static_cast<std::uint16_t>(t);
  }
  if (count < kFewest) return false;
  pair.i = i;
  pair.j = j;
  pair.n = std::min(count, kMost);
  pair.direction.setZero();
  for (int s = 0; s < pair.n; ++s) {
    const StartTrack& t = problem.tracks[shared[static_cast<std::size_t>(s * count / pair.n)]];
    pair.a[s] = problem.R_BC * t.f_C[view_of(t, i)];
    pair.b[s] = problem.R_BC * t.f_C[view_of(t, j)];
  }
  return true;
}

/// Pairs of three spans: a quarter, half and all of the frames. Returns how many.
int gather_all(const StartProblem& problem, std::array<Pair, kPairs>& pairs) {
  const int last = problem.frames - 1;
  int n = 0, before = 0;
  for (const int span : {std::max(1, last / 4), std::max(1, last / 2), last}) {
    if (span == before) continue;
    before = span;
    for (int i = 0; i + span <= last && n < kPairs; i += std::max(1, span / 2))
      n += gather(problem, i, i + span, pairs[n]);
  }
  return n;
}

/// Variance of x . (a x Rb) for bearing noise sigma and a unit vector x; `Rb` = R b. The floor keeps bearings along x
/// finite.
double variance(const Vec3& a, const Vec3& Rb, const Vec3& x, double sigma) {
  const double along_a = a.dot(x), along_b = Rb.dot(x);
  return sigma * sigma * (2 - along_a * along_a - along_b * along_b + 1e-6);
}

/// The robust null vector of the coplanarity normals, from where it was found last.
Vec3 translation_direction(const Pair& pair, const Mat3& R, double sigma, double kernel) {
  Vec3 x = pair.direction;
  for (int round = x.isZero() || kernel >= kAnew ? 0 : 1; round < 2; ++round) {
    Mat3 M = Mat3::Zero();
    for (int s = 0; s < pair.n; ++s) {
      const Vec3 Rb = R * pair.b[s], n = pair.a[s].cross(Rb);
      double w = 1;
      if (round > 0) {
        const double v = variance(pair.a[s], Rb, x, sigma), e = n.dot(x);
        w = 1 / (v + e * e / (kernel * kernel));
      }
      M += (w * n) * n.transpose();
    }
    Eigen::SelfAdjointEigenSolver<Mat3> eigen;
    eigen.computeDirect(M);
    x = eigen.eigenvectors().col(0);
  }
  return x;
}

/// Adds one pair's normal equations in b_g; the two degrees of freedom of the direction are projected out.
/// J: right perturbation of R by b_g.
void add_pair(Pair& pair, const Mat3& R, const Mat3& J, double sigma, double kernel, Mat3& H, Vec3& g) {
  const Vec3 x = pair.direction = translation_direction(pair, R, sigma, kernel);
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
    const double e = scale * n.dot(x), w = 1 / (1 + e * e / (kernel * kernel));
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
  const double information = 1 / (problem.b_g_sigma * problem.b_g_sigma);
  Vec3 b = b_g;
  std::array<Pair, kPairs> pairs;
  const int count = gather_all(problem, pairs);
  if (count < 3) return false;
  StartPath path;
  for (const double kernel : kKernel) {
    chain(problem, b, Vec3::Zero(), path);
    Mat3 H = information * Mat3::Identity();
    Vec3 g = information * (problem.b_g_ref - b);
    for (int n = 0; n < count; ++n) {
      Pair& pair = pairs[static_cast<std::size_t>(n)];
      const Mat3 R = path[pair.i].R.transpose() * path[pair.j].R;
      add_pair(pair, R, path[pair.j].theta_b - R.transpose() * path[pair.i].theta_b, problem.sigma_rad, kernel, H, g);
    }
    const Vec3 step = H.ldlt().solve(g);
    if (!step.allFinite()) return false;
    b += step;
  }
  b_g = b;
  return true;
}

}  // namespace epiline
