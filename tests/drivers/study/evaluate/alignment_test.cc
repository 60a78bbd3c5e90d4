// Derivation: docs/derivations/alignment.md. Checked against Eigen's Umeyama (singular values, where ours takes
// eigenvectors of Horn's matrix) and, for four degrees of freedom, against a numerical search over the yaw angle.
#include "drivers/study/evaluate/alignment.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

namespace epiline {
namespace {

struct Points {
  std::vector<Vec3> estimate, reference;
};

/// A winding path, moved by a random similarity and disturbed by `noise` metres.
Points random_points(unsigned seed, double scale, double noise) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const auto vec = [&] { return Vec3(normal(random), normal(random), normal(random)); };
  const Mat3 R = Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random))
                     .normalized()
                     .toRotationMatrix();
  const Vec3 t = 100 * vec();
  Points p;
  Vec3 x = Vec3::Zero(), v = vec();
  for (int i = 0; i < 200; ++i) {
    v += 0.3 * vec();
    x += 0.1 * v;
    p.estimate.push_back(x);
    p.reference.push_back(scale * (R * x) + t + noise * vec());
  }
  return p;
}

Eigen::Matrix3Xd columns(const std::vector<Vec3>& points) {
  Eigen::Matrix3Xd m(3, static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) m.col(static_cast<Eigen::Index>(i)) = points[i];
  return m;
}

double cost(const Points& p, const Similarity& T) {
  double sum = 0;
  for (std::size_t i = 0; i < p.estimate.size(); ++i) sum += (p.reference[i] - T(p.estimate[i])).squaredNorm();
  return sum;
}

/// For one yaw, the best translation is the mean of what is left.
Similarity with_yaw(const Points& p, double yaw) {
  Similarity T;
  T.R << std::cos(yaw), -std::sin(yaw), 0, std::sin(yaw), std::cos(yaw), 0, 0, 0, 1;
  for (std::size_t i = 0; i < p.estimate.size(); ++i) T.t += p.reference[i] - T.R * p.estimate[i];
  T.t /= static_cast<double>(p.estimate.size());
  return T;
}

/// Best of a grid of angles, then narrowed down by thirds.
Similarity search_yaw(const Points& p) {
  constexpr double kStep = 0.01;
  double best = 0;
  for (double yaw = 0; yaw < 6.3; yaw += kStep) {
    if (cost(p, with_yaw(p, yaw)) < cost(p, with_yaw(p, best))) best = yaw;
  }
  double low = best - kStep, high = best + kStep;
  for (int i = 0; i < 100; ++i) {
    const double a = low + (high - low) / 3, b = high - (high - low) / 3;
    (cost(p, with_yaw(p, a)) < cost(p, with_yaw(p, b)) ? high : low) =
        cost(p, with_yaw(p, a)) < cost(p, with_yaw(p, b)) ? b : a;
  }
  return with_yaw(p, 0.5 * (low + high));
}

class AlignmentOfSeed : public testing::TestWithParam<unsigned> {};

TEST_P(AlignmentOfSeed, AgreesWithUmeyama) {
  for (const bool scaled : {false, true}) {
    const Points p = random_points(GetParam(), scaled ? 0.3 + 0.2 * GetParam() : 1.0, 0.2);
    const Similarity T = align(scaled ? Alignment::kSim3 : Alignment::kSe3, p.estimate, p.reference);
    const Eigen::Matrix4d U = Eigen::umeyama(columns(p.estimate), columns(p.reference), scaled);
    EXPECT_LT((U.topLeftCorner<3, 3>() - T.s * T.R).norm(), 1e-9);
    EXPECT_LT((U.topRightCorner<3, 1>() - T.t).norm(), 1e-7);
    EXPECT_NEAR(T.R.determinant(), 1, 1e-12);
  }
}

TEST_P(AlignmentOfSeed, FourDegreesOfFreedomAgreeWithASearch) {
  const Points p = random_points(GetParam(), 1.0, 0.2);  // tilted against each other as well: a residual is left
  const Similarity T = align(Alignment::k4Dof, p.estimate, p.reference), S = search_yaw(p);
  EXPECT_NEAR(cost(p, T), cost(p, S), 1e-6 * cost(p, S));
  EXPECT_LT((T.R - S.R).norm(), 1e-6);
  EXPECT_LT((T.t - S.t).norm(), 1e-4);
  EXPECT_LT((T.R * Vec3::UnitZ() - Vec3::UnitZ()).norm(), 1e-15);
}

INSTANTIATE_TEST_SUITE_P(Seeds, AlignmentOfSeed, testing::Range(1u, 21u));

TEST(Alignment, FindsBackAnExactMotionEvenAtHalfATurn) {
  Points p = random_points(3, 1, 0);
  const Mat3 R = Eigen::AngleAxisd(3.14159265358979, Vec3(1, 2, 3).normalized()).toRotationMatrix();
  for (std::size_t i = 0; i < p.estimate.size(); ++i) p.reference[i] = 2.5 * (R * p.estimate[i]) + Vec3(1, 2, 3);
  const Similarity T = align(Alignment::kSim3, p.estimate, p.reference);
  EXPECT_NEAR(T.s, 2.5, 1e-12);
  EXPECT_LT((T.R - R).norm(), 1e-12);
  EXPECT_LT((T.t - Vec3(1, 2, 3)).norm(), 1e-10);
}

TEST(Alignment, DegenerateInputGivesFiniteResults) {
  const std::vector<Vec3> none, one{{1, 2, 3}}, same(5, Vec3(1, 2, 3));
  for (const Alignment family : {Alignment::kNone, Alignment::k4Dof, Alignment::kSe3, Alignment::kSim3}) {
    EXPECT_TRUE(align(family, none, none).R.isIdentity());
    EXPECT_LT((align(family, one, one)(one[0]) - one[0]).norm(), 1e-12);
    EXPECT_LT((align(family, same, same)(same[0]) - same[0]).norm(), 1e-12);
  }
}

}  // namespace
}  // namespace epiline
