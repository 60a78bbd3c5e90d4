// Derivation: docs/derivations/alignment.md. Checked against Eigen's Umeyama (singular values, where ours takes
// eigenvectors of Horn's matrix), for four degrees of freedom in the plane.
#include "drivers/study/evaluate/alignment.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
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

// The points are tilted against each other as well: a residual is left.
TEST_P(AlignmentOfSeed, FourDegreesOfFreedomAreAMotionInThePlaneAndAShiftAlongZ) {
  const Points p = random_points(GetParam(), 1.0, 0.2);
  const Similarity T = align(Alignment::k4Dof, p.estimate, p.reference);
  const Eigen::Matrix3Xd e = columns(p.estimate), r = columns(p.reference);
  const Eigen::MatrixXd U =
      Eigen::umeyama(Eigen::MatrixXd(e.topRows(2)), Eigen::MatrixXd(r.topRows(2)), /*with_scaling=*/false);
  EXPECT_LT((U.topLeftCorner(2, 2) - T.R.topLeftCorner<2, 2>()).norm(), 1e-9);
  EXPECT_LT((U.topRightCorner(2, 1) - T.t.head<2>()).norm(), 1e-7);
  EXPECT_NEAR((r.row(2) - e.row(2)).mean(), T.t.z(), 1e-9);
  EXPECT_LT((T.R * Vec3::UnitZ() - Vec3::UnitZ()).norm(), 1e-15);
  EXPECT_EQ(T.s, 1);
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
