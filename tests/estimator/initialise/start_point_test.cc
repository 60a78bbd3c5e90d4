// What the tracks say of the start once their points are eliminated, on every instruction set of this machine.
// Derivation: docs/derivations/initialisation.md.
#include "estimator/initialise/start_point.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "tests/estimator/dense_algebra.h"
#include "tests/estimator/initialise/start_flight.h"
#include "tests/estimator/slope.h"

namespace epiline::test {
namespace {

using Share = PointElimination::Share;

constexpr double kSigma = 1e-3, kKernel = 4;

StartCameras cameras(const StartFlight& f, const StartState& s) {
  StartPath path;
  chain(f.problem, s.b_g, s.b_a, path);
  StartCameras camera;
  place_cameras(f.problem, path, s, camera);
  return camera;
}

/// d g_0 / d (its two turns).
GravityTurns turns_of_gravity(const StartState& s) { return kGravity * gravity_basis(s.g_0); }

/// Tracks with holes, of which each starts and ends in frames of its own.
StartFlight ragged_flight(unsigned seed, int points) {
  StartFlight f = fly(wandering(seed), {.points = points, .noise_rad = kSigma, .outliers = 0.02});
  for (std::size_t t = 0; t < f.tracks.size(); ++t) {
    StartTrack& track = f.tracks[t];
    const int hole = 1 + static_cast<int>(t) % 5;
    if (t % 2 == 0 || hole + 1 >= track.count) continue;
    for (int q = hole; q + 1 < track.count; ++q) {
      track.frame[q] = track.frame[q + 1];
      track.f_C[q] = track.f_C[q + 1];
    }
    --track.count;
  }
  return f;
}

/// A point of the reference: direction from the first camera of its track, and inverse distance.
struct ReferencePoint {
  Vec3 m;
  double rho;
};

/// The least squares of the derivation, straight: one track, no lanes, derivatives by differences.
struct Reference {
  const StartFlight& flight;
  const StartTrack& track;

  /// Residuals in the plane tangent to each bearing, in sigmas; the bearings are turned with their cameras.
  Eigen::VectorXd residuals(const StartState& s, const ReferencePoint& x, const Vec3& origin) const {
    StartPath path;
    chain(flight.problem, s.b_g, s.b_a, path);
    Eigen::VectorXd r(3 * track.count);
    for (int q = 0; q < track.count; ++q) {
      const StartFrame& frame = path[track.frame[q]];
      const Vec3 c = frame.position(s) + frame.R * flight.problem.p_BC;
      const Mat3 R_WC = frame.R * flight.problem.R_BC;
      const Vec3 ray = R_WC.transpose() * (x.m + x.rho * (origin - c)), &f = track.f_C[q];
      r.segment<3>(3 * q) = (f - ray / f.dot(ray)) / kSigma;
    }
    return r;
  }
  Vec3 origin(const StartState& s) const {
    StartPath path;
    chain(flight.problem, s.b_g, s.b_a, path);
    const StartFrame& frame = path[track.frame[0]];
    return frame.position(s) + frame.R * flight.problem.p_BC;
  }
  double depth_information(const StartState& s) const {
    StartPath path;
    chain(flight.problem, s.b_g, s.b_a, path);
    double sum = 0;
    for (int q = 0; q < track.count; ++q) {
      const StartFrame& frame = path[track.frame[q]];
      const Vec3 d = origin(s) - frame.position(s) - frame.R * flight.problem.p_BC;
      sum += (frame.R * flight.problem.R_BC * track.f_C[q]).cross(d).squaredNorm();
    }
    return sum / (kSigma * kSigma);
  }
};

/// Slopes of a function of n numbers at zero.
template <class F>
Eigen::MatrixXd slopes(int n, double h, F&& f) {
  const Eigen::VectorXd at = f(Eigen::VectorXd::Zero(n));
  Eigen::MatrixXd J(at.size(), n);
  for (int i = 0; i < n; ++i) {
    const Eigen::VectorXd d = h * Eigen::VectorXd::Unit(n, i);
    J.col(i) = (8 * (f(d) - f(-d)) - (f(2 * d) - f(-2 * d))) / (12 * h);
  }
  return J;
}

/// The tracks in their order, eight to a batch.
std::vector<StartBatch> pack(const std::vector<StartTrack>& tracks) {
  std::vector<StartBatch> batches((tracks.size() + kBatchLanes - 1) / kBatchLanes, StartBatch{{}, kStartFrames, 0});
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    StartBatch& batch = batches[t / kBatchLanes];
    for (int q = 0; q < tracks[t].count; ++q) {
      const int k = tracks[t].frame[q];
      batch.first = std::min(batch.first, k);
      batch.last = std::max(batch.last, k);
      for (int i = 0; i < 3; ++i) batch.f[k][i][t % kBatchLanes] = tracks[t].f_C[q][i];
    }
  }
  return batches;
}

class StartPoint : public testing::TestWithParam<InstructionSet> {
 protected:
  void SetUp() override {
    if (!runs_here(GetParam())) GTEST_SKIP() << "this processor has no " << name_of(GetParam());
    points = std::make_unique<PointElimination>(GetParam());
  }
  StartWeights weights(int steps) const { return {kSigma * kSigma, kKernel * kKernel, steps}; }
  /// The points after `steps` steps.
  StartNormal eliminate(const std::vector<StartTrack>& tracks, const StartFlight& f, const StartState& s, int steps) {
    const StartCameras camera = cameras(f, s);
    const std::vector<StartBatch> batches = pack(tracks);
    const Eigen::Matrix<double, 3, 2, Eigen::RowMajor> gravity = turns_of_gravity(s);
    found.assign(batches.size(), {});
    start_kernels(GetParam())
        .eliminate(batches.data(), static_cast<int>(batches.size()), camera.data(), f.problem.frames, gravity.data(),
                   weights(steps), std::vector<StartPoints>(batches.size()).data(), found.data(), *scratch, equations);
    StartNormal sum;
    add(equations, camera, f.problem.frames, turns_of_gravity(s), sum);
    return sum;
  }
  ReferencePoint point(int t) const {
    const StartPoints& x = found[static_cast<std::size_t>(t / kBatchLanes)];
    const int lane = t % kBatchLanes;
    return {{x.m[0][lane], x.m[1][lane], x.m[2][lane]}, x.rho[lane]};
  }

  std::unique_ptr<PointElimination> points;
  std::unique_ptr<StartScratch> scratch = std::make_unique<StartScratch>();
  StartEquations equations;
  std::vector<StartPoints> found;
};

/// Against points and start as unknowns of one dense system, the points eliminated from it by its Schur complement.
TEST_P(StartPoint, IsEliminatedAsFromADenseSystem) {
  const StartFlight f = ragged_flight(4, 29);
  StartState at = f.truth;
  at.v_0 += Vec3(0.01, -0.02, 0.01);
  eliminate(f.tracks, f, at, 2);
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(kStartDof, kStartDof);
  Eigen::VectorXd b = Eigen::VectorXd::Zero(kStartDof);
  double cost = 0;
  for (std::size_t t = 0; t < f.tracks.size(); ++t) {
    const StartTrack& track = f.tracks[t];
    const Reference reference{f, track};
    const Vec3 origin = reference.origin(at);
    const ReferencePoint x = point(static_cast<int>(t));
    const Eigen::MatrixXd by_start =
        slopes(kStartDof, 1e-4, [&](const Eigen::VectorXd& d) { return reference.residuals(moved(at, d), x, origin); });
    const Eigen::MatrixXd by_point = slopes(3, 1e-4, [&](const Eigen::VectorXd& d) {
      return reference.residuals(at, {x.m + d, x.rho}, origin);
    });
    const Eigen::VectorXd r = reference.residuals(at, x, origin);
    Eigen::MatrixXd J(r.size(), kStartDof + 3), dense = Eigen::MatrixXd::Zero(kStartDof + 3, kStartDof + 3);
    J << by_start, by_point;
    Eigen::VectorXd rhs = Eigen::VectorXd::Zero(kStartDof + 3);
    for (int q = 0; q < track.count; ++q) {
      const double scaled = r.segment<3>(3 * q).squaredNorm() / (kKernel * kKernel);
      cost += kKernel * kKernel * std::log1p(scaled);
      add_equations(1 / (1 + scaled), J.middleRows(3 * q, 3), r.segment(3 * q, 3), dense, rhs);
    }
    const double damping = std::max(0.0, 0.04 - reference.depth_information(at)) * x.rho * x.rho;
    dense.bottomRightCorner<3, 3>() += damping / std::pow(x.m.norm(), 4) * x.m * x.m.transpose();
    const Eigen::MatrixXd C = inverse(dense.bottomRightCorner(3, 3)), with = dense.bottomLeftCorner(3, kStartDof);
    H += dense.topLeftCorner(kStartDof, kStartDof) - congruence(C, with);
    b += rhs.head(kStartDof) - product(with.transpose(), product(C, rhs.tail(3)));
  }
  const StartCameras camera = cameras(f, at);
  points->collect(f.problem);
  points->eliminate(camera, turns_of_gravity(at), kSigma, kKernel, Share::kAll, equations);
  StartNormal sum;
  add(equations, camera, f.problem.frames, turns_of_gravity(at), sum);
  for (int i = 0; i < kStartDof; ++i) {
    const double scale = std::sqrt(H(i, i));
    EXPECT_NEAR(sum.b[i], b[i], 1e-5 * scale) << "unknown " << i;
    for (int j = i; j < kStartDof; ++j)
      EXPECT_NEAR(sum.H(i, j), H(i, j), 1e-6 * scale * std::sqrt(H(j, j))) << i << ", " << j;
  }
  EXPECT_NEAR(sum.cost, cost, 1e-9 * cost);
}

TEST_P(StartPoint, NormalEquationsHaveTheSlopeOfTheCost) {
  const StartFlight f = ragged_flight(5, 30);
  StartState at = f.truth;
  at.v_0 += Vec3(0.01, -0.02, 0.01);
  const StartNormal sum = eliminate(f.tracks, f, at, 40);
  for (int i = 0; i < kStartDof; ++i) {
    const double sigma = 1 / std::sqrt(sum.H(i, i));
    const auto cost = [&](double d) { return eliminate(f.tracks, f, moved(at, d * StartVector::Unit(i)), 40).cost; };
    const double expected = -0.5 * slope(cost, 0.02 * sigma);
    EXPECT_NEAR(sum.b[i] * sigma, expected * sigma, 1e-6 * (1 + std::abs(expected * sigma))) << "unknown " << i;
  }
}

TEST_P(StartPoint, IsWhereTheCamerasSawIt) {
  StartFlight f = fly(wandering(6), {.imu_per_interval = 200});
  const StartCameras camera = cameras(f, f.truth);
  eliminate(f.tracks, f, f.truth, 30);
  int seen = 0;
  for (std::size_t t = 0; t < f.tracks.size(); ++t) {
    const StartTrack& track = f.tracks[t];
    if (track.count < 8) continue;
    ++seen;
    const ReferencePoint x = point(static_cast<int>(t));
    const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(camera[track.frame[0]].R);
    EXPECT_LT((x.m.normalized() - R * track.f_C[0]).norm(), 1e-5);
    EXPECT_GT(x.rho, 1 / 9.0);  // the points are 1.5 to 7.5 m away, and a little aside
    EXPECT_LT(x.rho, 1 / 1.4);
  }
  EXPECT_GT(seen, 50);
  points->collect(f.problem);
  points->eliminate(camera, turns_of_gravity(f.truth), kSigma, kKernel, Share::kAll, equations);
  points->accept();
  int tracks;
  EXPECT_LT(points->typical_residual(camera, kSigma, kKernel, tracks), 1e-2);
  EXPECT_GE(tracks, seen);
}

/// A gross error of a bearing says nothing of the start but costs.
TEST_P(StartPoint, BehindACameraABearingHasNoDerivative) {
  const StartFlight f = fly(wandering(7), {});
  StartTrack track = f.tracks[0];
  ASSERT_GT(track.count, 4);
  const int last = track.count - 1, k = track.frame[last];
  track.f_C[last] *= -1;
  const StartNormal with = eliminate({track}, f, f.truth, 10);
  for (const double x : equations.H_pose[k]) EXPECT_EQ(x, 0);
  for (const double x : equations.b_pose[k]) EXPECT_EQ(x, 0);
  --track.count;
  const StartNormal without = eliminate({track}, f, f.truth, 10);
  EXPECT_LT((with.b - without.b).norm(), 1e-6 * (1 + without.b.norm()));
  const double expected = kKernel * kKernel * std::log1p(kStartBehind2 / (kKernel * kKernel));
  EXPECT_NEAR(with.cost - without.cost, expected, 1e-6 * expected);
}

/// The wide stages see every third track, and no batch mixes the shares.
TEST_P(StartPoint, AThirdIsEveryThirdTrack) {
  StartFlight f = ragged_flight(8, 100);
  std::vector<StartTrack> third;
  for (std::size_t t = 0; t < f.tracks.size(); t += 3) third.push_back(f.tracks[t]);
  int freedom = -kStartDof;
  for (const StartTrack& t : third) freedom += 2 * t.count - 3;
  const StartCameras camera = cameras(f, f.truth);
  points->collect(f.problem);
  EXPECT_EQ(points->freedom(Share::kThird), freedom);
  points->eliminate(camera, turns_of_gravity(f.truth), kSigma, kKernel, Share::kThird, equations);
  const StartEquations some = equations;
  f.problem.tracks = third;
  points->collect(f.problem);
  EXPECT_EQ(points->freedom(Share::kAll), freedom);
  points->eliminate(camera, turns_of_gravity(f.truth), kSigma, kKernel, Share::kAll, equations);
  EXPECT_NEAR(some.cost, equations.cost, 1e-9 * equations.cost);
  for (int i = 0; i < kStartDof; ++i) EXPECT_NEAR(some.H[i][i], equations.H[i][i], 1e-9 * std::abs(some.H[i][i]));
}

/// The widest of all pairs of bearings, cameras' rotation removed.
TEST_P(StartPoint, ParallaxIsTheMedianOfTheWidestAngles) {
  const StartFlight f = ragged_flight(9, 60);
  const StartCameras camera = cameras(f, f.truth);
  points->collect(f.problem);
  std::vector<double> widest;
  for (const StartTrack& track : f.tracks) {
    if (track.count < 3) continue;
    double most = 0;
    for (int i = 0; i < track.count; ++i)
      for (int j = 0; j < i; ++j) {
        const auto bearing = [&](int q) -> Vec3 { return f.R[track.frame[q]] * f.problem.R_BC * track.f_C[q]; };
        most = std::max(most, std::acos(std::min(1.0, bearing(i).dot(bearing(j)))));
      }
    widest.push_back(most);
  }
  std::nth_element(widest.begin(), widest.begin() + widest.size() / 2, widest.end());
  EXPECT_NEAR(points->parallax(camera), widest[widest.size() / 2], 1e-4);
}

using RowMat3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

/// The first tracks of a flight, seen in frames 0 and 8, in the body's axes.
StartPair pair_of(const StartFlight& f, int tracks) {
  StartPair pair{};
  for (const StartTrack& t : f.tracks) {
    if (pair.tracks == tracks || t.count < 9 || t.frame[8] != 8) continue;
    for (int r = 0; r < 3; ++r) {
      pair.a[r][pair.tracks] = f.problem.R_BC.row(r).dot(t.f_C[0]);
      pair.b[r][pair.tracks] = f.problem.R_BC.row(r).dot(t.f_C[8]);
    }
    ++pair.tracks;
  }
  return pair;
}

/// Straight from the derivation: the residual n.t, and its slope by a turn of frame 8.
TEST_P(StartPoint, SumsOfAPairAreThoseOfItsTracks) {
  const StartFlight f = ragged_flight(4, 100);
  const StartPair pair = pair_of(f, 13);  // fills no number of lanes
  ASSERT_EQ(pair.tracks, 13);
  const Mat3 R = f.R[8] * so3_exp(Vec3(0.002, -0.001, 0.003));
  const Vec3 t = (f.p[8] + Vec3(0.01, 0, 0)).normalized();
  Mat3 nn = Mat3::Zero(), nq = Mat3::Zero(), qq = Mat3::Zero(), plain = Mat3::Zero();
  for (int s = 0; s < pair.tracks; ++s) {
    const Vec3 a(pair.a[0][s], pair.a[1][s], pair.a[2][s]), b(pair.b[0][s], pair.b[1][s], pair.b[2][s]),
        n = a.cross(R * b);
    Vec3 q;
    for (int i = 0; i < 3; ++i)
      q[i] = slope([&](double d) { return a.cross(so3_exp(d * Vec3::Unit(i)) * R * b).dot(t); }, 1e-3);
    const double variance = kSigma * kSigma * ((R * b).cross(t).squaredNorm() + a.cross(t).squaredNorm());
    const double w = 1 / (variance + n.dot(t) * n.dot(t) / (kKernel * kKernel));
    plain += n * n.transpose();
    nn += w * n * n.transpose();
    nq += w * n * q.transpose();
    qq += w * q * q.transpose();
  }
  const RowMat3 rows = R;
  const StartKernels& kernels = start_kernels(GetParam());
  StartPairSums sums;
  const auto expect = [](const double* sum, const Mat3& expected) {
    EXPECT_LT((Eigen::Map<const RowMat3>(sum) - expected).norm(), 1e-5 * expected.norm());
  };
  kernels.see_normals(pair, rows.data(), nullptr, weights(0), sums);
  expect(sums.nn, plain);
  kernels.see_normals(pair, rows.data(), t.data(), weights(0), sums);
  expect(sums.nn, nn);
  kernels.see_pair(pair, rows.data(), t.data(), weights(0), sums);
  expect(sums.nn, nn);
  expect(sums.nq, nq);
  expect(sums.qq, qq);
}

/// Normal equations in (v_0, g_0).
struct LinearSums {
  Mat3 vv = Mat3::Zero(), vg = Mat3::Zero(), gg = Mat3::Zero();
  Vec3 v = Vec3::Zero(), g = Vec3::Zero();
};

/// The rows of one track, each divided by its noise, and what they must equal.
void add_linear_rows(const StartTrack& track, const StartCameras& camera, double least, const double (*at)[3],
                     LinearSums& sums) {
  const auto seen_by = [&](int q) -> const auto& { return camera[track.frame[q]]; };
  const auto ray = [&](int q) -> Vec3 { return Eigen::Map<const RowMat3>(seen_by(q).R) * track.f_C[q]; };
  const auto centre = [&](int q) -> Vec3 { return Eigen::Map<const Vec3>(seen_by(q).c); };
  int i = 0, j = 0;
  double sine2 = 0;
  for (int k = 0; k < track.count; ++k)
    for (int l = k + 1; l < track.count; ++l)
      if (const double s = ray(k).cross(ray(l)).squaredNorm(); s > sine2) i = k, j = l, sine2 = s;
  if (track.count < 3 || sine2 < least) return;
  const Vec3 a = ray(j).cross(ray(j).cross(ray(i)));
  for (int k = 0; k < track.count; ++k) {
    const auto row = [&](double i_less_j, double i_less_k) -> Mat3 {
      return skew(ray(k)) * (i_less_j * ray(i) * a.transpose() + sine2 * i_less_k * Mat3::Identity());
    };
    const Mat3 v = row(seen_by(i).T - seen_by(j).T, seen_by(i).T - seen_by(k).T),
               g = row(seen_by(i).half_T2 - seen_by(j).half_T2, seen_by(i).half_T2 - seen_by(k).half_T2);
    const Vec3 rest = skew(ray(k)) * (ray(i) * a.dot(centre(i) - centre(j)) + sine2 * (centre(i) - centre(k)));
    double w = 1 / sine2;
    if (at != nullptr) {
      const auto found = [&](int q) -> Vec3 { return Eigen::Map<const Vec3>(at[track.frame[q]]); };
      const double depth = a.dot(found(i) - found(j)) / sine2;
      const double noise = sine2 * kSigma * std::max(0.3, (std::abs(depth) * ray(i) + found(i) - found(k)).norm());
      const Vec3 e = skew(ray(k)) * (depth * sine2 * ray(i) + sine2 * (found(i) - found(k)));
      w = 1 / (noise * noise + e.squaredNorm() / 9);
    }
    sums.vv += w * v.transpose() * v;
    sums.vg += w * v.transpose() * g;
    sums.gg += w * g.transpose() * g;
    sums.v -= w * v.transpose() * rest;
    sums.g -= w * g.transpose() * rest;
  }
}

TEST_P(StartPoint, TheLinearSystemIsThatOfItsRows) {
  StartFlight f = ragged_flight(6, 45);
  for (int t = 0; t < 12; ++t) f.tracks[t].count = 2 + t % 3;  // two views say nothing, three do
  StartState at_rest = f.truth;
  at_rest.v_0 = at_rest.g_0 = Vec3::Zero();
  const StartCameras camera = cameras(f, at_rest), moved = cameras(f, f.truth);
  std::array<double[3], kStartFrames> at;
  for (int k = 0; k < f.problem.frames; ++k)
    for (int r = 0; r < 3; ++r) at[k][r] = moved[k].c[r] + 0.02 * r;
  points->collect(f.problem);
  for (const bool known : {false, true}) {
    const double least = 1e-5;
    LinearSums expected;
    for (const StartTrack& track : f.tracks)
      add_linear_rows(track, camera, least, known ? at.data() : nullptr, expected);
    const StartLinear system = points->linear(camera, least, kSigma, known ? at.data() : nullptr);
    const auto expect = [&](const double* block, const Mat3& sum) {
      EXPECT_LT((Eigen::Map<const RowMat3>(block) - sum).norm(), 1e-9 * sum.norm()) << known;
    };
    expect(system.vv, expected.vv);
    expect(system.vg, expected.vg);
    expect(system.gg, expected.gg);
    EXPECT_LT((Eigen::Map<const Vec3>(system.v) - expected.v).norm(), 1e-9 * expected.v.norm()) << known;
    EXPECT_LT((Eigen::Map<const Vec3>(system.g) - expected.g).norm(), 1e-9 * expected.g.norm()) << known;
    EXPECT_GT(system.tracks, 10);
    EXPECT_LT(system.tracks, 45);
  }
}

INSTANTIATE_TEST_SUITE_P(Sets, StartPoint, testing::ValuesIn(kInstructionSets),
                         [](const auto& test) { return name_of(test.param); });

}  // namespace
}  // namespace epiline::test
