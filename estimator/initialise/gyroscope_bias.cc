#include "estimator/initialise/gyroscope_bias.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <bit>

#include "estimator/initialise/start_path.h"

namespace epiline {
namespace {

constexpr int kFewest = 15;  // common tracks a pair needs
constexpr int kPairs = 13;   // of frames, see gather_all()
// One iteration each; in sigmas. A wide kernel pulls from afar, the last one forgets gross errors.
constexpr std::array<double, 6> kKernel = {64, 16, 8, 4, 2, 2};
constexpr double kAnew = 8;  // with a kernel this wide the direction is sought without regard to the last one

struct Pair {
  int i = 0, j = 0;
  StartPair bearings;
  Vec3 direction = Vec3::Zero();  ///< of the translation, as found last; zero: unknown
};

void put(const Vec3& v, double (*to)[kPairTracks], int lane) {
  for (int r = 0; r < 3; ++r) to[r][lane] = v[r];
}

/// Which frames see each track: bit k for frame k.
using Seen = std::array<std::uint32_t, kStartTracks>;

int see_tracks(const StartProblem& problem, Seen& seen) {
  const int tracks = std::min<int>(kStartTracks, static_cast<int>(problem.tracks.size()));
  for (int t = 0; t < tracks; ++t) {
    seen[t] = 0;
    for (int q = 0; q < problem.tracks[t].count; ++q) seen[t] |= 1u << problem.tracks[t].frame[q];
  }
  return tracks;
}

/// Of a track's bearings, the one in a frame that sees it.
const Vec3& bearing(const StartTrack& track, std::uint32_t seen, int frame) {
  return track.f_C[std::popcount(seen & ((1u << frame) - 1))];
}

/// False: too few.
bool gather(const StartProblem& problem, const Seen& seen, int tracks, int i, int j, Pair& pair) {
  const std::uint32_t both = 1u << i | 1u << j;
  std::array<std::uint16_t, kStartTracks> shared;
  int count = 0;
  for (int t = 0; t < tracks; ++t)
    if ((seen[t] & both) == both) shared[count++] = static_cast<std::uint16_t>(t);
  if (count < kFewest) return false;
  pair.i = i;
  pair.j = j;
  pair.direction.setZero();
  StartPair& bearings = pair.bearings = {};
  bearings.tracks = std::min(count, kPairTracks);
  for (int s = 0; s < bearings.tracks; ++s) {
    const int t = shared[s * count / bearings.tracks];
    put(problem.R_BC * bearing(problem.tracks[t], seen[t], i), bearings.a, s);
    put(problem.R_BC * bearing(problem.tracks[t], seen[t], j), bearings.b, s);
  }
  return true;
}

/// Pairs of three spans: a quarter, half and all of the frames. Returns how many.
int gather_all(const StartProblem& problem, std::array<Pair, kPairs>& pairs) {
  Seen seen;
  const int tracks = see_tracks(problem, seen), last = problem.frames - 1;
  int n = 0, before = 0;
  for (const int span : {std::max(1, last / 4), std::max(1, last / 2), last}) {
    if (span == before) continue;
    before = span;
    for (int i = 0; i + span <= last && n < kPairs; i += std::max(1, span / 2))
      n += gather(problem, seen, tracks, i, i + span, pairs[n]);
  }
  return n;
}

/// The sums over a pair's tracks, for the noise and the kernel of an iteration.
struct Sums {
  const StartKernels& kernels;
  StartWeights weights;

  /// Of n n'. `t`: direction of the translation; null: all tracks count the same.
  Mat3 normals(const StartPair& pair, const Mat3& R, const Vec3* t) const {
    const RowMat3 rows = R;
    StartPairSums sums;
    kernels.see_normals(pair, rows.data(), t == nullptr ? nullptr : t->data(), weights, sums);
    return Eigen::Map<const RowMat3>(sums.nn);
  }
  void all(const StartPair& pair, const Mat3& R, const Vec3& t, Mat3& nn, Mat3& nq, Mat3& qq) const {
    const RowMat3 rows = R;
    StartPairSums sums;
    kernels.see_pair(pair, rows.data(), t.data(), weights, sums);
    nn = Eigen::Map<const RowMat3>(sums.nn);
    nq = Eigen::Map<const RowMat3>(sums.nq);
    qq = Eigen::Map<const RowMat3>(sums.qq);
  }
};

/// The robust null vector of the coplanarity normals, from where it was found last.
Vec3 translation_direction(const Pair& pair, const Mat3& R, const Sums& sums) {
  Vec3 t = pair.direction;
  const bool anew = t.isZero() || sums.weights.kernel2 >= kAnew * kAnew;
  for (int round = anew ? 0 : 1; round < 2; ++round) {
    Eigen::SelfAdjointEigenSolver<Mat3> eigen;
    eigen.computeDirect(sums.normals(pair.bearings, R, round > 0 ? &t : nullptr));
    t = eigen.eigenvectors().col(0);
  }
  return t;
}

/// Adds one pair's normal equations in b_g; the two degrees of freedom of the direction are projected out.
/// J: right perturbation of R by b_g. e = n.t changes by q.(R J db_g) and by n.dt, and dt is orthogonal to t.
void add_pair(Pair& pair, const Mat3& R, const Mat3& J, const Sums& sums, Mat3& H, Vec3& g) {
  const Vec3 t = pair.direction = translation_direction(pair, R, sums);
  Mat3 nn, nq, qq;
  sums.all(pair.bearings, R, t, nn, nq, qq);
  Eigen::Matrix<double, 3, 2> T;
  T.col(0) = t.unitOrthogonal();
  T.col(1) = t.cross(T.col(0));
  const Mat3 B = R * J;
  const Eigen::Matrix<double, 2, 3> X = T.transpose() * nq * B;
  const Eigen::Matrix2d K_inverse = (T.transpose() * nn * T + 1e-6 * Eigen::Matrix2d::Identity()).inverse();
  H += B.transpose() * qq * B - X.transpose() * K_inverse * X;
  g -= B.transpose() * nq.transpose() * t - X.transpose() * K_inverse * T.transpose() * nn * t;
}

}  // namespace

bool solve_gyroscope_bias(const StartProblem& problem, const StartKernels& kernels, Vec3& b_g) {
  const double information = 1 / (problem.b_g_sigma * problem.b_g_sigma);
  Vec3 b = b_g;
  std::array<Pair, kPairs> pairs;
  const int count = gather_all(problem, pairs);
  if (count < 3) return false;
  StartPath path;
  for (const double kernel : kKernel) {
    const Sums sums{kernels, {problem.sigma_rad * problem.sigma_rad, kernel * kernel, 0}};
    chain(problem, b, Vec3::Zero(), path);
    Mat3 H = information * Mat3::Identity();
    Vec3 g = information * (problem.b_g_ref - b);
    for (int n = 0; n < count; ++n) {
      Pair& pair = pairs[static_cast<std::size_t>(n)];
      const Mat3 R = path[pair.i].R.transpose() * path[pair.j].R;
      add_pair(pair, R, path[pair.j].theta_b - R.transpose() * path[pair.i].theta_b, sums, H, g);
    }
    const Vec3 step = H.ldlt().solve(g);
    if (!step.allFinite()) return false;
    b += step;
  }
  b_g = b;
  return true;
}

}  // namespace epiline
