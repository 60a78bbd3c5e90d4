#include "estimator/geometry/so3.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

namespace epiline::test {
namespace {

// Around zero, the switch between series and closed form (|theta|^2 = 1e-4 .. 0.25), pi, and 2 pi.
const double kAngles[] = {0,    1e-300,  1e-200, 1e-12,       1e-9,        1e-8,        1e-7,         1e-5, 1e-4,
                          1e-3, 0.00999, 0.01,   0.0101,      0.1,         0.3,         0.499,        0.5,  0.501,
                          1,    2,       3,      M_PI - 1e-3, M_PI - 1e-6, M_PI - 1e-9, M_PI - 1e-12, M_PI};
const double kBeyondPi[] = {M_PI + 1e-9, 4, 5, 6, 2 * M_PI - 0.01, 2 * M_PI - 1e-4};
const Vec3 kAxes[] = {Vec3::UnitX(),
                      Vec3::UnitY(),
                      Vec3::UnitZ(),
                      -Vec3::UnitZ(),
                      Vec3(1, 1, 1).normalized(),
                      Vec3(-1, 1e-9, 0).normalized(),
                      Vec3(0.3, -0.8, 0.52).normalized(),
                      Vec3(1e-5, 1, -1).normalized()};

template <class F>
void each_rotation_vector(bool beyond_pi, F&& law) {
  for (const Vec3& axis : kAxes) {
    for (const double angle : kAngles) law(angle * axis, angle, axis);
    if (beyond_pi)
      for (const double angle : kBeyondPi) law(angle * axis, angle, axis);
  }
}

TEST(So3, ExpIsTheRotationAboutTheAxis) {
  each_rotation_vector(true, [](const Vec3& theta, double angle, const Vec3& axis) {
    const Mat3 R = so3_exp(theta);
    EXPECT_LT((R - Eigen::AngleAxisd(angle, axis).toRotationMatrix()).norm(), 2e-15) << angle;
    EXPECT_LT((R * R.transpose() - Mat3::Identity()).norm(), 3e-15) << angle;
  });
}

TEST(So3, LogInvertsExp) {
  each_rotation_vector(false, [](const Vec3& theta, double angle, const Vec3& axis) {
    const Vec3 back = so3_log(so3_exp(theta));
    EXPECT_LE(back.norm(), M_PI + 1e-15);
    // Within rounding of pi both signs are right.
    const double error =
        angle > M_PI - 1e-8 ? std::min((back - theta).norm(), (back + theta).norm()) : (back - theta).norm();
    EXPECT_LT(error, 5e-15 * std::max(angle, 0.1)) << angle << " about " << axis.transpose();
    if (angle < 1e-7) {
      EXPECT_LT(error, 1e-15 * angle + 1e-320) << angle;  // relative: tiny rotations keep their digits
    }
  });
}

TEST(So3, LogAtPiIsPiAboutTheAxis) {
  for (const Vec3& axis : kAxes) {
    const Mat3 R = 2 * axis * axis.transpose() - Mat3::Identity();
    const Vec3 theta = so3_log(R);
    EXPECT_NEAR(theta.norm(), M_PI, 1e-14);
    EXPECT_NEAR(std::abs(theta.dot(axis)), M_PI, 1e-14);
  }
}

// J_r(theta) = int_0^1 Exp(-s theta) ds, by Gauss-Legendre on 64 pieces.
TEST(So3, RightJacobianIsTheIntegralOfTheExponential) {
  each_rotation_vector(true, [](const Vec3& theta, double angle, const Vec3& axis) {
    Mat3 integral = Mat3::Zero();
    const double g = std::sqrt(0.6) / 2;
    for (int n = 0; n < 64; ++n)
      for (const auto& [x, w] : {std::pair{0.5 - g, 5.0 / 18}, std::pair{0.5, 8.0 / 18}, std::pair{0.5 + g, 5.0 / 18}})
        integral += w / 64 * Eigen::AngleAxisd(-(n + x) / 64 * angle, axis).toRotationMatrix();
    EXPECT_LT((so3_right_jacobian(theta) - integral).norm(), 1e-12) << angle;
  });
}

TEST(So3, RightJacobianPredictsTheExponential) {
  each_rotation_vector(true, [](const Vec3& theta, double angle, const Vec3&) {
    const Vec3 d = 1e-5 * Vec3(0.5, -0.7, 0.4);
    const Vec3 moved = so3_log(so3_exp(theta - d).transpose() * so3_exp(theta + d));
    EXPECT_LT((moved - 2 * so3_right_jacobian(theta) * d).norm(), 1e-14) << angle;
  });
}

TEST(So3, InverseOfTheRightJacobian) {
  each_rotation_vector(true, [](const Vec3& theta, double angle, const Vec3&) {
    const Mat3 J = so3_right_jacobian(theta), inverse = so3_right_jacobian_inverse(theta);
    ASSERT_TRUE(inverse.allFinite()) << angle;
    // It grows like 1 / (2 pi - angle).
    EXPECT_LT((J * inverse - Mat3::Identity()).norm(), 1e-14 * inverse.norm()) << angle;
  });
}

TEST(So3, SkewIsTheCrossProduct) {
  const Vec3 a(1, -2, 3), b(0.4, 5, -6);
  EXPECT_EQ(skew(a) * b, a.cross(b));
  EXPECT_EQ(skew(a).transpose(), -skew(a));
}

RC_GTEST_PROP(So3Property, NormalisedRemovesDrift, (std::uint32_t seed)) {
  std::mt19937 engine(seed);
  std::normal_distribution<double> normal;
  const auto vector = [&](double s) { return Vec3(s * normal(engine), s * normal(engine), s * normal(engine)); };
  const Mat3 R = so3_exp(vector(2));
  Mat3 drift;
  drift << vector(1e-6), vector(1e-6), vector(1e-6);
  const Mat3 back = so3_normalised(R + drift);
  RC_ASSERT((back * back.transpose() - Mat3::Identity()).norm() < 1e-14);
  RC_ASSERT(back.determinant() > 0);
  RC_ASSERT((back - R).norm() < 2 * drift.norm());
}

}  // namespace
}  // namespace epiline::test
