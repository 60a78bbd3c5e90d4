// One track's point and what it says of the start once it is eliminated. Derivation:
// docs/derivations/initialisation.md.
#include "estimator/initialise/start_point.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/estimator/initialise/start_flight.h"
#include "tests/estimator/slope.h"

namespace epiline {
namespace {

using testing::Flight;
using testing::FlightSettings;

constexpr double kSigma = 1e-3, kKernel = 4;

/// The cameras of a start.
StartViews views(const Flight& f, const StartState& s) {
  StartPath path;
  chain(f.problem, s.b_g, s.b_a, path);
  StartViews view;
  for (int k = 0; k < f.problem.frames; ++k) {
    StartView& v = view[k];
    v.T = path[k].T;
    v.p = path[k].position(s);
    v.R = path[k].R * f.problem.R_BC;
    v.c = v.p + path[k].R * f.problem.p_BC;
    v.p_b = path[k].alpha_b;
    v.dphi = path[k].rotation_rows();
  }
  return view;
}

/// d g_0 / d (its two turns).
Eigen::Matrix<double, 3, 2> turns_of_gravity(const StartState& s) { return kGravity * gravity_basis(s.g_0); }

/// All tracks, their points converged.
StartSums sums(const Flight& f, const StartState& s) {
  const StartViews view = views(f, s);
  StartSums sum(f.problem.frames);
  for (const StartTrack& track : f.problem.tracks) {
    PointElimination point(track, view, kSigma, kKernel);
    point.solve({}, 40);
    point.add_to(turns_of_gravity(s), sum);
  }
  sum.finish(view, f.problem.frames, turns_of_gravity(s));
  return sum;
}

TEST(StartPoint, NormalEquationsHaveTheSlopeOfTheCost) {
  FlightSettings settings;
  settings.noise_rad = kSigma;
  settings.points = 30;
  Flight f;
  testing::fly(testing::wandering(5), settings, f);
  StartState at = f.truth;
  at.v_0 += Vec3(0.01, -0.02, 0.01);
  const StartSums sum = sums(f, at);
  for (int i = 0; i < kStartDof; ++i) {
    const double sigma = 1 / std::sqrt(sum.total.H(i, i));
    const auto cost = [&](double d) {
      StartVector step = StartVector::Zero();
      step[i] = d;
      return sums(f, moved(at, step)).total.cost;
    };
    const double expected = -0.5 * test::slope(cost, 0.02 * sigma);
    EXPECT_NEAR(sum.total.b[i] * sigma, expected * sigma, 1e-6 * (1 + std::abs(expected * sigma))) << "unknown " << i;
  }
}

TEST(StartPoint, IsWhereTheCamerasSawIt) {
  FlightSettings settings;
  settings.imu_per_interval = 200;
  Flight f;
  testing::fly(testing::wandering(6), settings, f);
  const StartViews view = views(f, f.truth);
  int seen = 0;
  for (const StartTrack& track : f.problem.tracks) {
    if (track.count < 8) continue;
    ++seen;
    PointElimination point(track, view, kSigma, kKernel);
    point.solve({}, 30);
    const Vec3 m = point.point().m.normalized();
    EXPECT_LT((m - view[track.frame[0]].R * track.f_C[0]).norm(), 1e-5);
    for (int q = 0; q < track.count; ++q) EXPECT_LT(point.residual2(q), 1e-4);
    EXPECT_GT(point.point().rho, 1 / 9.0);  // the points are 1.5 to 7.5 m away, and a little aside
    EXPECT_LT(point.point().rho, 1 / 1.4);
  }
  EXPECT_GT(seen, 50);
}

/// A gross error of a bearing says nothing of the start but costs.
TEST(StartPoint, BehindACameraABearingHasNoDerivative) {
  Flight f;
  testing::fly(testing::wandering(7), {}, f);
  const StartViews view = views(f, f.truth);
  StartTrack track = f.problem.tracks[0];
  ASSERT_GT(track.count, 4);
  StartSums without(f.problem.frames), with(f.problem.frames);
  for (StartSums* sum : {&without, &with}) {
    StartTrack t = track;
    if (sum == &without) {
      --t.count;
    } else {
      t.f_C[t.count - 1] *= -1;
    }
    PointElimination point(t, view, kSigma, kKernel);
    point.solve({}, 10);
    point.add_to(turns_of_gravity(f.truth), *sum);
    if (sum == &with) {
      EXPECT_EQ(point.residual2(t.count - 1), 1e6);
    }
  }
  const int k = track.frame[track.count - 1];
  EXPECT_TRUE(with.H[k].isZero(0));
  EXPECT_TRUE(with.b[k].isZero(0));
  EXPECT_LT((with.total.b - without.total.b).norm(), 1e-6 * (1 + without.total.b.norm()));
  EXPECT_GT(with.total.cost, without.total.cost + kKernel);
}

}  // namespace
}  // namespace epiline
