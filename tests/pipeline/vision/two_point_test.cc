#include "pipeline/vision/two_point.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "estimator/geometry/types.h"
#include "tests/pipeline/vision/support.h"

#include <Eigen/Dense>

namespace epiline {
namespace {

constexpr double kPixel = 1.0 / 458;  // rad

struct Scene {
  std::vector<Vec3> before, now;
  Vec3 direction;
};

void add(Scene& scene, const Vec3& before, const Vec3& now) {
  scene.before.push_back(before.normalized());
  scene.now.push_back(now.normalized());
}

/// Points 2 to 8 m away in a cone of the given half angle; the camera moves by `travel`, its rotation taken out
/// already.
Scene moving_scene(int points, const Vec3& travel, double half_angle_rad, std::mt19937& random, double noise_px = 0) {
  Scene scene;
  scene.direction = travel.norm() > 0 ? Vec3(travel.normalized()) : Vec3::UnitZ();
  std::uniform_real_distribution<double> unit(0, 1);
  std::normal_distribution<double> noise(0, 1);
  for (int i = 0; i < points; ++i) {
    const double a = half_angle_rad * std::sqrt(unit(random)), b = 2 * std::numbers::pi * unit(random);
    const Vec3 bearing(std::sin(a) * std::cos(b), std::sin(a) * std::sin(b), std::cos(a));
    const Vec3 point = (2 + 6 * unit(random)) * bearing;
    add(scene, bearing,
        (point - travel).normalized() + noise_px * kPixel * Vec3(noise(random), noise(random), noise(random)));
  }
  return scene;
}

BearingPairs pairs_of(const Scene& scene) {
  BearingPairs pairs;
  pairs.size = static_cast<int>(scene.before.size());
  for (int i = 0; i < pairs.size; ++i) {
    const Eigen::Vector3f a = scene.before[i].cast<float>(), b = scene.now[i].cast<float>();
    pairs.before_x[i] = a.x(), pairs.before_y[i] = a.y(), pairs.before_z[i] = a.z();
    pairs.now_x[i] = b.x(), pairs.now_y[i] = b.y(), pairs.now_z[i] = b.z();
  }
  return pairs;
}

// Smallest change of both bearings (rad, squared sum) that makes the pair coplanar with t, to first order.
double reference_distance2(const Vec3& a, const Vec3& b, const Vec3& t) {
  const double e = b.dot(t.cross(a));
  const Vec3 da = b.cross(t), db = t.cross(a);
  const auto tangent = [](const Vec3& g, const Vec3& f) { return Vec3(g - g.dot(f) * f).squaredNorm(); };
  return e * e / (tangent(da, a) + tangent(db, b));
}

TEST(DirectionCost, EqualsTheFirstOrderDistanceForEveryNumberOfPairs) {
  std::mt19937 random(1);
  on_every_target([&] {
    for (int n = 1; n <= 70; ++n) {
      const Scene scene = moving_scene(n, Vec3(0.1, -0.05, 0.2), 1.9, random, 3);
      const Vec3 t = Vec3(0.3, -0.2, 0.8).normalized();
      const float direction[3] = {static_cast<float>(t.x()), static_cast<float>(t.y()), static_cast<float>(t.z())};
      const double limit2 = std::pow(4 * kPixel, 2);
      alignas(64) float distance2[BearingPairs::kCapacity];
      const BearingPairs pairs = pairs_of(scene);
      const double total = direction_cost(pairs, direction, static_cast<float>(limit2), distance2);
      double expected = 0;
      for (int i = 0; i < n; ++i) {
        const double d2 = reference_distance2(scene.before[i], scene.now[i], t);
        ASSERT_NEAR(std::sqrt(distance2[i]), std::sqrt(d2), 1e-6 + 1e-3 * std::sqrt(d2)) << i << " of " << n;
        expected += std::min(d2, limit2);
      }
      ASSERT_NEAR(total, expected, 1e-3 * expected + 1e-9) << n;
    }
  });
}

// The first-order distance is what the name says: moving both bearings by it makes the pair coplanar.
TEST(DirectionCost, IsTheDistanceOfAPairThatWasMovedByIt) {
  std::mt19937 random(2);
  const Scene clean = moving_scene(40, Vec3(0.2, 0.1, 0.1), 0.6, random);
  Scene moved = clean;
  for (std::size_t i = 0; i < clean.now.size(); ++i) {  // across the epipolar plane, in one image only
    const Vec3 normal = clean.direction.cross(clean.before[i]).normalized();
    moved.now[i] = (clean.now[i] + 2 * kPixel * normal).normalized();
  }
  const float t[3] = {static_cast<float>(clean.direction.x()), static_cast<float>(clean.direction.y()),
                      static_cast<float>(clean.direction.z())};
  alignas(64) float distance2[BearingPairs::kCapacity];
  direction_cost(pairs_of(moved), t, 1.f, distance2);
  for (std::size_t i = 0; i < clean.now.size(); ++i) {  // two images share the error: a factor of sqrt(2), nearly
    EXPECT_NEAR(std::sqrt(distance2[i]) / kPixel, 2 / std::sqrt(2), 0.1);
  }
}

void judge(const Scene& scene, std::array<bool, BearingPairs::kCapacity>& inlier) {
  BearingPairs pairs = pairs_of(scene);
  find_inliers(pairs, {.limit_rad = static_cast<float>(kPixel)}, inlier);
}

TEST(TwoPoint, RejectsOutliersAndKeepsInliers) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(-1, 1);
  on_every_target([&] {
    for (const Vec3& travel : {Vec3(0.2, 0, 0), Vec3(0, 0, 0.3), Vec3(-0.1, 0.1, 0.1)}) {
      Scene scene = moving_scene(105, travel, 0.7, random, 0.1);
      for (int i = 0; i < 45; ++i) {  // 30 % wrong: off their epipolar planes by 5 px and more
        const Vec3 f = Vec3(0.5 * unit(random), 0.5 * unit(random), 1).normalized();
        const Vec3 normal = travel.cross(f).normalized();
        add(scene, f, f + (5 + 20 * std::abs(unit(random))) * kPixel * normal);
      }
      std::array<bool, BearingPairs::kCapacity> inlier;
      judge(scene, inlier);
      const auto kept = std::count(inlier.begin(), inlier.begin() + 105, true);
      const auto wrong = std::count(inlier.begin() + 105, inlier.begin() + 150, true);
      EXPECT_GE(kept, 103) << travel.transpose();
      EXPECT_LE(wrong, 2) << travel.transpose();
    }
  });
}

// A rotation wrong by 0.008 rad: everybody moves by about 4 px more than it says.
TEST(TwoPoint, AWrongRotationIsNotBlamedOnTheTracks) {
  std::mt19937 random(6);
  std::uniform_real_distribution<double> unit(-1, 1);
  std::ptrdiff_t kept = 0, slipped = 0;
  for (int round = 0; round < 30; ++round) {
    const Vec3 travel = 0.2 * Vec3(unit(random), unit(random), unit(random));
    const Vec3 axis = Vec3(unit(random), unit(random), unit(random)).normalized();
    const Mat3 wrong = Eigen::AngleAxisd(0.008, axis).toRotationMatrix();
    Scene scene = moving_scene(130, travel, 0.7, random, 0.1);
    for (int i = 0; i < 20; ++i) {
      const Vec3 f = Vec3(0.5 * unit(random), 0.5 * unit(random), 1).normalized();
      add(scene, f, f + (8 + 20 * std::abs(unit(random))) * kPixel * travel.cross(f).normalized());
    }
    for (Vec3& f : scene.before) f = wrong * f;
    std::array<bool, BearingPairs::kCapacity> inlier;
    judge(scene, inlier);
    kept += std::count(inlier.begin(), inlier.begin() + 130, true);
    slipped += std::count(inlier.begin() + 130, inlier.begin() + 150, true);
  }
  EXPECT_GT(kept, 0.86 * 30 * 130);  // 89 %; without the correction 82 %
  EXPECT_LT(slipped, 0.1 * 30 * 20);
}

TEST(TwoPoint, StandingStillRejectsNothing) {
  std::mt19937 random(4);
  for (double noise_px : {0.0, 0.05}) {
    const Scene scene = moving_scene(150, Vec3::Zero(), 0.7, random, noise_px);
    std::array<bool, BearingPairs::kCapacity> inlier;
    judge(scene, inlier);
    EXPECT_EQ(std::count(inlier.begin(), inlier.begin() + 150, true), 150);
  }
}

TEST(TwoPoint, TooFewPairsAreNotJudged) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (int n : {0, 1, 2, 9}) {
    Scene scene;
    for (int i = 0; i < n; ++i) add(scene, Vec3(unit(random), unit(random), 1), Vec3(unit(random), unit(random), 1));
    std::array<bool, BearingPairs::kCapacity> inlier;
    judge(scene, inlier);
    EXPECT_TRUE(std::all_of(inlier.begin(), inlier.end(), [](bool b) { return b; })) << n;
  }
}

RC_GTEST_PROP(TwoPoint, ExactPairsAreInliersForAnyTravelAndField, ()) {
  std::mt19937 random(*rc::gen::arbitrary<unsigned>());
  std::uniform_real_distribution<double> unit(-1, 1);
  const Vec3 travel = 0.3 * Vec3(unit(random), unit(random), unit(random));
  const double half_angle = 0.3 + 1.6 * std::abs(unit(random));  // also beyond 90 degrees
  const int n = 10 + static_cast<int>(random() % 390);
  const Scene scene = moving_scene(n, travel, half_angle, random);
  std::array<bool, BearingPairs::kCapacity> inlier, again;
  judge(scene, inlier);
  const auto kept = std::count(inlier.begin(), inlier.begin() + n, true);
  RC_ASSERT(static_cast<double>(kept) >= 0.97 * n);
  judge(scene, again);
  RC_ASSERT(inlier == again);
}

}  // namespace
}  // namespace epiline
