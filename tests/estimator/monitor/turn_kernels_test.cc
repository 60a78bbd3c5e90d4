// The arithmetic of a camera's turn, of every instruction set that this machine has, against plain loops in double
// precision. Derivation: docs/derivations/turns.md.
#include "estimator/monitor/turn_kernels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "estimator/geometry/so3.h"

namespace epiline::test {
namespace {

using RowMat3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

Vec3 at(const BearingRows& rows, int i) { return {rows.x[i], rows.y[i], rows.z[i]}; }
void set(BearingRows& rows, int i, const Vec3& f) {
  rows.x[i] = static_cast<float>(f.x());
  rows.y[i] = static_cast<float>(f.y());
  rows.z[i] = static_cast<float>(f.z());
}

constexpr double kScale = 1e-3;
double excess(double e) { return 1 + e * e / (kScale * kScale); }

/// J'wJ and J'w r in double precision, with the sizes of what was summed: by those the errors are judged. An angle of
/// 1 mrad has four digits, and so has its weight.
template <int n>
struct Sums {
  Eigen::Matrix<double, n, n> H = Eigen::Matrix<double, n, n>::Zero(), sizes = H;
  Eigen::Matrix<double, n, 1> b = Eigen::Matrix<double, n, 1>::Zero(), sizes_b = b;
  double cost = 0;

  void add(const Eigen::Matrix<double, n, 1>& J, double weight, double r) {
    H += weight * J * J.transpose();
    sizes += weight * J.cwiseAbs() * J.cwiseAbs().transpose();
    b += weight * J * r;
    sizes_b += weight * J.cwiseAbs() * std::abs(r);
  }
  void expect_near(const double* H_found, const double* b_found) const {
    for (int row = 0, k = 0; row < n; ++row) {
      for (int column = 0; column <= row; ++column, ++k)
        EXPECT_NEAR(H_found[k], H(row, column), 1e-3 * sizes(row, column)) << row << ", " << column;
      EXPECT_NEAR(b_found[row], b[row], 1e-3 * sizes_b[row]) << row;
    }
  }
};

class TurnKernelsOf : public testing::TestWithParam<InstructionSet> {
 protected:
  void SetUp() override {
    if (!runs_here(GetParam())) GTEST_SKIP() << "this processor has no " << name_of(GetParam());
    std::mt19937 random(3);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> depth(2, 8);
    for (int i = 0; i < kMostShared; ++i) set(before_, i, Vec3::Zero()), set(now_, i, Vec3::Zero());
    for (int i = 0; i < kThere; ++i) {
      const Vec3 p = depth(random) * Vec3(0.6 * normal(random), 0.6 * normal(random), 1).normalized();
      const Vec3 noise = 2e-3 * Vec3(normal(random), normal(random), normal(random));
      set(before_, i, p.normalized());
      set(now_, i, ((R_ * p + 0.2 * t_).normalized() + (i % 9 == 0 ? 30 : 1) * noise).normalized());
    }
  }
  const TurnKernels& kernels() const { return turn_kernels(GetParam()); }
  /// What EpipolarAngles holds of bearing i, in double precision.
  double scale(int i) const { return 1 / std::max(t_.cross(at(now_, i)).norm(), 0.1); }
  double angle(int i) const { return -scale(i) * t_.cross(at(now_, i)).dot(R_ * at(before_, i)); }

  static constexpr int kThere = 53;
  BearingRows before_, now_;
  const RowMat3 R_ = so3_exp(Vec3(0.02, -0.05, 0.03));
  const Vec3 t_ = Vec3(0.4, -0.2, 0.7).normalized();
};

TEST_P(TurnKernelsOf, MeasuresAnglesToEpipolarPlanes) {
  EpipolarAngles found;
  const double cost = kernels().look(before_, now_, R_.data(), t_.data(), found);
  double expected = 0;
  for (int i = 0; i < kThere; ++i) {
    EXPECT_NEAR(found.e[i], angle(i), 1e-6);
    EXPECT_NEAR(found.scale[i], scale(i), 1e-5);
    EXPECT_LT((at(found.g, i) - R_ * at(before_, i)).norm(), 1e-6);
    expected += std::log(excess(angle(i)));
  }
  EXPECT_NEAR(cost, expected, 2e-3 * expected);
  EXPECT_GT(expected, 10);
}

/// The slopes by differences of the angles themselves.
TEST_P(TurnKernelsOf, SumsTheEquationsOfTurnAndDirection) {
  EpipolarAngles angles;
  kernels().look(before_, now_, R_.data(), t_.data(), angles);
  Eigen::Matrix<double, 3, 2> across;
  across.col(0) = t_.unitOrthogonal();
  across.col(1) = t_.cross(across.col(0));
  Sums<5> expected;
  for (int i = 0; i < kThere; ++i) {
    const Vec3 f = at(now_, i), g = R_ * at(before_, i);
    const auto e = [&](int column, double h) {
      const Vec3 turned = column < 3 ? so3_exp(h * Vec3::Unit(column)) * g : g;
      const Vec3 t = column < 3 ? t_ : Vec3(t_ + h * across.col(column - 3));
      return -scale(i) * t.cross(f).dot(turned);  // the scale is held
    };
    Eigen::Matrix<double, 5, 1> J;
    for (int c = 0; c < 5; ++c) J[c] = (e(c, 1e-6) - e(c, -1e-6)) / 2e-6;
    expected.add(J, 1 / excess(angle(i)), -angle(i));
  }
  double H[15], b[5];
  kernels().equations(now_, angles, t_.data(), across.data(), H, b);
  expected.expect_near(H, b);
}

TEST_P(TurnKernelsOf, SumsTheEquationsOfAPlane) {
  Parallaxes rows;
  kernels().parallaxes(before_, now_, R_.data(), t_.data(), rows);
  const Vec3 n(0.01, -0.02, 0.05);
  Sums<3> plain, robust;
  for (int i = 0; i < kThere; ++i) {
    const Vec3 f = at(now_, i), along = t_.cross(f);
    const double moved = along.norm(), seen = f.cross(R_ * at(before_, i)).dot(along) / moved;
    const Vec3 J = moved * at(before_, i);
    plain.add(J, 1, seen);
    robust.add(J, 1 / excess(seen - n.dot(J)), seen);
    robust.cost += std::log(excess(seen - n.dot(J)));
  }
  double H[6], b[3];
  kernels().plane(rows, nullptr, H, b);
  plain.expect_near(H, b);
  EXPECT_NEAR(kernels().plane(rows, n.data(), H, b), robust.cost, 1e-3 * robust.cost);
  robust.expect_near(H, b);
}

INSTANTIATE_TEST_SUITE_P(InstructionSets, TurnKernelsOf, testing::ValuesIn(kInstructionSets),
                         [](const auto& set) { return name_of(set.param); });

}  // namespace
}  // namespace epiline::test
