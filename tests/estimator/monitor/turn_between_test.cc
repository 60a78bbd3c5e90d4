// The turn of a camera between two images, of points anywhere and of points in a plane: docs/derivations/turns.md.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "estimator/geometry/so3.h"
#include "estimator/monitor/turn_watch.h"

namespace epiline::test {
namespace {

const TurnKernels& kernels = turn_kernels(best_instruction_set());

TEST(TurnBetween, FindsTheTurnBesideAnyTranslation) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> depth(2, 8);
  int fitted = 0;
  for (int trial = 0; trial < 40; ++trial) {
    const Mat3 R_CC0 = so3_exp(0.1 * Vec3(normal(random), normal(random), normal(random)));
    const Vec3 t = 0.15 * Vec3(normal(random), normal(random), normal(random));
    SharedBearings s;
    s.count = SharedBearings::kMost;
    for (int i = 0; i < s.count; ++i) {
      const Vec3 p = depth(random) * Vec3(0.7 * normal(random), 0.7 * normal(random), 1);
      s.before.set(i, p.normalized());
      s.now.set(i, (R_CC0 * p + t).normalized());
      if (i % 8 == 0)  // a false match
        s.now.set(i, (s.now.at(i) + 0.05 * Vec3(normal(random), normal(random), 0)).normalized());
    }
    CameraTurn turn;
    ASSERT_TRUE(turn_between(s, Mat3::Identity(), Vec3::UnitX(), 0, kernels, turn));
    if (turn.cost > 1) continue;  // no fit, and TurnWatch leaves it out
    ++fitted;
    EXPECT_LT(so3_log(R_CC0.transpose() * turn.R_CC0).norm(), 0.01) << trial << " cost " << turn.cost;
  }
  EXPECT_GE(fitted, 30);
}

/// Two views of points in a plane, or of points up to `relief` behind it.
struct OverAPlane {
  Mat3 R_CC0;
  Vec3 t, n;
  SharedBearings bearings;

  OverAPlane(std::mt19937& random, const Vec3& travel, double view, double relief) {
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> side(-view, view);
    R_CC0 = so3_exp(0.02 * Vec3(normal(random), normal(random), normal(random)));
    t = travel.cwiseProduct(Vec3(normal(random), normal(random), normal(random)));
    n = Vec3(0.2 * normal(random), 0.2 * normal(random), 1);
    bearings.count = SharedBearings::kMost;
    for (int i = 0; i < bearings.count; ++i) {
      const Vec3 f = Vec3(side(random), side(random), 1).normalized();
      const Vec3 p = f / n.dot(f) * (1 + relief * std::abs(normal(random)));
      bearings.before.set(i, f);
      bearings.now.set(i, (R_CC0 * p + t + 2e-4 * Vec3(normal(random), normal(random), 0)).normalized());
    }
  }
  double apart() const { return (R_CC0.transpose() * t).cross(n).norm(); }
  double off(const CameraTurn& turn) const { return so3_log(R_CC0.transpose() * turn.R_CC0).norm(); }
  CameraTurn right() const { return fit(R_CC0, t); }
  /// A homography R + t n' is nearly one of the rotation beside it, R + n t'.
  CameraTurn other() const { return fit(so3_exp(t.cross(R_CC0 * n)) * R_CC0, R_CC0 * n); }

 private:
  CameraTurn fit(const Mat3& R, const Vec3& direction) const {
    CameraTurn turn;
    EXPECT_TRUE(turn_between(bearings, R, direction.normalized(), 1, kernels, turn));
    return turn;
  }
};

TEST(TurnBetween, SaysHowFarOffTheOtherTurnOverAPlaneIs) {
  std::mt19937 random(5);
  int planes = 0;
  for (int trial = 0; trial < 40; ++trial) {
    // towards the plane, and in a narrow view: either has all points in front of the camera
    const OverAPlane made(random, Vec3(0.003, 0.003, 0.1), 0.3, 0);
    CameraTurn turn = made.right();
    if (turn.cost > 0.35 || made.off(turn) > 2e-3 || made.apart() < 0.01) continue;
    ++planes;
    const CameraTurn before = turn;
    EXPECT_NEAR(settle_plane(made.bearings, 0, kernels, turn), made.apart(), 0.2 * made.apart() + 2e-3) << trial;
    EXPECT_EQ(made.off(turn), made.off(before)) << trial;
    EXPECT_LT(made.other().cost, turn.cost + 0.1) << "the other turn explains it as well, trial " << trial;
    EXPECT_NEAR(settle_plane(made.bearings, 1, kernels, turn), made.apart(), 0.2 * made.apart() + 2e-3) << trial;
  }
  EXPECT_GE(planes, 10);
}

TEST(TurnBetween, TakesTheTurnThatHasThePlaneInFront) {
  std::mt19937 random(6);
  int right = 0, other = 0;
  for (int trial = 0; trial < 40; ++trial) {
    const OverAPlane made(random, Vec3(0.05, 0.05, 0.01), 0.8, 0);
    if (std::abs(made.t.z()) > 0.3 * made.t.head<2>().norm()) continue;  // not across the view
    for (const bool from_other : {false, true}) {
      CameraTurn turn = from_other ? made.other() : made.right();
      if (made.apart() < 0.02 || turn.cost > 0.35) continue;
      if ((made.off(turn) > 0.5 * made.apart()) != from_other) continue;
      (from_other ? other : right) += 1;
      EXPECT_EQ(settle_plane(made.bearings, 0.01, kernels, turn), 0) << trial;
      EXPECT_LT(made.off(turn), 3e-3) << trial << " from the other one: " << from_other;
    }
  }
  EXPECT_GE(right, 20);
  EXPECT_GE(other, 20);
}

TEST(TurnBetween, PointsInNoPlaneLeaveOneTurn) {
  std::mt19937 random(7);
  for (int trial = 0; trial < 40; ++trial) {
    const OverAPlane made(random, Vec3(0.05, 0.05, 0.015), 0.8, 0.4);
    CameraTurn turn = made.right();
    const double off = made.off(turn);
    EXPECT_TRUE(settle_plane(made.bearings, 0.01, kernels, turn) == 0 || made.t.norm() < 0.04) << trial;
    EXPECT_EQ(made.off(turn), off) << trial;
  }
}

TEST(TurnBetween, UnrelatedBearingsCostMuchButNotInfinitely) {
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  SharedBearings s;
  s.count = SharedBearings::kMost;
  for (auto* bearings : {&s.before, &s.now})
    for (int i = 0; i < s.count; ++i)
      bearings->set(i, Vec3(normal(random), normal(random), normal(random)).normalized());
  CameraTurn turn;
  ASSERT_TRUE(turn_between(s, Mat3::Identity(), Vec3::UnitX(), 0, kernels, turn));
  EXPECT_GT(turn.cost, 5);
  EXPECT_LE(turn.cost, std::log1p(1e6));  // an angle of 1 rad, everywhere
}

/// What stands beyond `count` must not count: the same bearings four times give the same motion.
TEST(TurnBetween, OnlyTheBearingsThatAreThereCount) {
  std::mt19937 random(8);
  constexpr int kFew = SharedBearings::kMost / 4;
  for (int trial = 0; trial < 20; ++trial) {
    const OverAPlane made(random, Vec3(0.05, 0.05, 0.015), 0.8, 0.4);
    SharedBearings few, many = made.bearings;
    few.count = kFew;
    for (int i = 0; i < many.count; ++i) {
      for (auto table : {&SharedBearings::before, &SharedBearings::now}) {
        if (i < kFew) (few.*table).set(i, (made.bearings.*table).at(i));
        (many.*table).set(i, (made.bearings.*table).at(i % kFew));
      }
    }
    CameraTurn turn_of_few, turn_of_many;
    ASSERT_TRUE(turn_between(few, made.R_CC0, made.t.normalized(), 1, kernels, turn_of_few));
    ASSERT_TRUE(turn_between(many, made.R_CC0, made.t.normalized(), 1, kernels, turn_of_many));
    EXPECT_NEAR(turn_of_few.cost, turn_of_many.cost, 1e-3 * turn_of_many.cost) << trial;
    EXPECT_LT(so3_log(turn_of_few.R_CC0.transpose() * turn_of_many.R_CC0).norm(), 1e-4) << trial;
  }
}

TEST(TurnBetween, TooFewBearingsGiveNone) {
  SharedBearings s;
  s.count = SharedBearings::kFewest - 1;
  CameraTurn turn;
  EXPECT_FALSE(turn_between(s, Mat3::Identity(), Vec3::UnitX(), 0, kernels, turn));
}

}  // namespace
}  // namespace epiline::test
