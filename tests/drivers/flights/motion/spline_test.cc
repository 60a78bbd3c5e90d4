#include "drivers/flights/motion/spline.h"

#include <gtest/gtest.h>

#include <cmath>

#include "drivers/flights/motion/random.h"
#include "estimator/geometry/so3.h"

namespace epiline {
namespace {

TEST(CubicSplineTest, ReproducesAQuadratic) {
  // For c_i = f(t_i) - h^2/6 f'' the spline is f itself when f is quadratic.
  const double h = 0.4;
  const auto f = [](double t) { return Vec3(1 + 2 * t - 0.7 * t * t, -3 * t * t, 4); };
  const Vec3 second(-1.4, -6, 0);
  std::vector<Vec3> controls;
  for (int i = 0; i < 12; ++i) controls.push_back(f((i - 1) * h) - h * h / 6 * second);
  const CubicSpline spline(h, controls);
  EXPECT_DOUBLE_EQ(spline.end_s(), 9 * h);
  for (double t = 0; t <= spline.end_s(); t += 0.037) {
    const CubicSpline::Value v = spline.at(t);
    EXPECT_LT((v.value - f(t)).norm(), 1e-12) << t;
    EXPECT_LT((v.first - Vec3(2 - 1.4 * t, -6 * t, 0)).norm(), 1e-12) << t;
    EXPECT_LT((v.second - second).norm(), 1e-11) << t;
  }
}

TEST(RotationSplineTest, TurnsAtAConstantRateIfItsControlsDo) {
  const double h = 0.3;
  const Vec3 omega(0.5, -1, 2);
  const Mat3 R_0 = so3_exp(Vec3(1, 2, -0.5));
  std::vector<Mat3> controls;
  for (int i = 0; i < 9; ++i) controls.push_back(R_0 * so3_exp((i - 1) * h * omega));
  const RotationSpline spline(h, controls);
  for (double t = 0; t <= spline.end_s(); t += 0.029) {
    const RotationSpline::Value v = spline.at(t);
    EXPECT_LT((v.R_WB - R_0 * so3_exp(t * omega)).norm(), 1e-13) << t;
    EXPECT_LT((v.omega_B - omega).norm(), 1e-13) << t;
  }
}

TEST(RotationSplineTest, RateAndAccelerationAreTheDerivativesAndHaveNoJumps) {
  constexpr double kStep = 1e-5, kKnotInterval_s = 0.2;
  Random random(3, 0);
  std::vector<Mat3> controls{Mat3::Identity()};
  for (int i = 0; i < 20; ++i) controls.push_back(controls.back() * so3_exp(random.normal3(0.5)));
  const RotationSpline spline(kKnotInterval_s, controls);
  for (int i = 0; i < 300; ++i) {
    const double t = random.uniform(kStep, spline.end_s() - kStep);
    const Mat3 turn = spline.at(t - kStep).R_WB.transpose() * spline.at(t + kStep).R_WB;
    EXPECT_LT((so3_log(turn) / (2 * kStep) - spline.at(t).omega_B).norm(), 1e-6) << t;
    const Vec3 change = (spline.at(t + kStep).omega_B - spline.at(t - kStep).omega_B) / (2 * kStep);
    const bool across_knot = std::abs(std::remainder(t, kKnotInterval_s)) < kStep;
    EXPECT_LT((change - spline.at(t).alpha_B).norm(), across_knot ? 1 : 1e-4) << t;
  }
  for (double knot = kKnotInterval_s; knot < spline.end_s() - 0.1; knot += kKnotInterval_s) {
    const RotationSpline::Value a = spline.at(knot - 1e-9), b = spline.at(knot + 1e-9);
    EXPECT_LT((a.R_WB - b.R_WB).norm(), 1e-7);
    EXPECT_LT((a.omega_B - b.omega_B).norm(), 1e-6);
    EXPECT_LT((a.alpha_B - b.alpha_B).norm(), 1e-4);
  }
}

}  // namespace
}  // namespace epiline
