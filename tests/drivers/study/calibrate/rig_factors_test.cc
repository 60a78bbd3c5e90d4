// Every derivative of a calibration's residuals against central differences of the residuals themselves. Derivation:
// docs/derivations/rig.md.
#include "drivers/study/calibrate/rig_factors.h"

#include <gtest/gtest.h>

#include <functional>

#include "tests/drivers/study/calibrate/waved_rig.h"

namespace epiline {
namespace {

BoardShape shape() {
  BoardShape shape({{WavedRig::kBegin, {{3, {0.2, 0.3, 0}, {300, 200}}}}});
  shape.offset(0) = {1e-3, -2e-3, 3e-3};
  return shape;
}

/// A state near the truth whose knots stand close, as in a fit, and every constant off its default.
RigState state_of(CameraModel model) {
  WavedRig rig;
  rig.lens = lens_of(model);
  RigState state;
  state.constants = {rig.lens,          rig.R_BC, rig.p_BC, rig.time_offset_s, shape(), rig.g_T(), {1.01, 0.99, 1.002},
                     {0.98, 1.01, 1.03}};
  state.constants.accelerometers_B << -3e-3, 1e-3, 2e-3, 7e-3, -6e-3, -1e-3, 5e-3, -2e-3, -3e-3;
  state.begin = WavedRig::kBegin;
  state.interval_s = 0.01;
  state.lead_s = 0.004;
  state.duration_s = 1;
  state.bias_interval_s = 0.6;
  for (int k = 0; k < 105; ++k) {
    const WavedRig::Pose pose = rig.pose((k - 1) * state.interval_s - state.lead_s);
    state.R_TB.push_back(pose.R_TB);
    state.p_TB.push_back(pose.p_TB);
  }
  state.gyroscope_bias = {{0.01, 0.02, -0.03}, {0.012, 0.018, -0.031}, {0.013, 0.02, -0.02}};
  state.accelerometer_bias = {{0.1, 0.2, -0.3}, {0.12, 0.18, -0.31}, {0.1, 0.1, -0.1}};
  return state;
}

RigState moved(const RigState& state, const RigLayout& layout, int column, double by) {
  RigState other = state;
  std::vector<double> step(layout.first.size(), 0.0);
  step[static_cast<std::size_t>(column)] = by;
  other.move(step, layout.knot, layout.bias, layout.columns, layout.corners);
  return other;
}

class Models : public testing::TestWithParam<CameraModel> {};

TEST_P(Models, CornersHaveTheirDerivatives) {
  const RigState state = state_of(GetParam());
  const RigLayout layout(state);
  const RigFactors factors(state, layout);
  const BoardCorner corner{3, {0.2, 0.3, 0}, {300, 200}};
  const double t_s = 0.4567;
  const RigFactors::View view = factors.look(t_s);
  Vec2 e;
  CornerJacobian J;
  Mat23 by_corner;
  ASSERT_TRUE(factors.corner(view, corner, e, J, by_corner));
  const auto error = [&](int column, double by) {
    const RigState other = moved(state, layout, column, by);
    const RigFactors there(other, layout);
    Vec2 e_there;
    CornerJacobian ignored;
    Mat23 ignored_too;
    EXPECT_TRUE(there.corner(there.look(t_s), corner, e_there, ignored, ignored_too));
    return e_there;
  };
  const auto numeric = [&](int column) -> Vec2 {
    const double h = 1e-6;
    return (error(column, -h) - error(column, h)) / (2 * h);  // J is of the projected pixel, e is minus it
  };
  for (int i = 0; i < layout.columns.gravity - layout.columns.begin; ++i)
    EXPECT_LT((numeric(layout.columns.begin + i) - J.col(6 + i)).norm(), 1e-4 * (1 + J.col(6 + i).norm())) << i;
  for (int i = 0; i < 3; ++i)
    EXPECT_LT((numeric(factors.column(corner) + i) - by_corner.col(i)).norm(), 1e-4 * by_corner.norm()) << i;
  for (std::size_t k = 0; k < 4; ++k) {
    for (int i = 0; i < 6; ++i) {
      const Vec2 expected = view.weight[k] * J.col(i);
      // a knot's turn moves the rotation by its weight only as far as neighbouring knots are alike
      EXPECT_LT((numeric(view.knot[k] + i) - expected).norm(), i < 3 ? 1e-4 : 0.03 * J.col(i).norm()) << k << " " << i;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, Models,
                         testing::Values(CameraModel::kPinholeRadialTangential, CameraModel::kPinholeEquidistant,
                                         CameraModel::kDoubleSphere));

using Residual = std::function<FitResidual(const RigFactors&)>;

void expect_derivatives(const Residual& residual) {
  const RigState state = state_of(CameraModel::kPinholeRadialTangential);
  const RigLayout layout(state);
  const FitResidual r = residual(RigFactors(state, layout));
  for (std::size_t i = 0; i < r.count; ++i) {
    for (int k = 0; k < r.terms[i].width; ++k) {
      const double h = 1e-6;
      const RigState plus = moved(state, layout, r.terms[i].column + k, h),
                     minus = moved(state, layout, r.terms[i].column + k, -h);
      const Vec3 numeric = (residual(RigFactors(plus, layout)).e - residual(RigFactors(minus, layout)).e) / (2 * h);
      const Vec3 given = r.terms[i].J.col(k);
      EXPECT_LT((numeric - given).norm(), 0.04 * (1 + given.norm())) << "term " << i << ", column " << k;
    }
  }
}

/// Readings that agree with the motion: there the derivatives that leave out products with the residual are exact but
/// for the turn from knot to knot, of up to 0.04 rad.
RigReading agreeing(const RigState& state, double t_s) {
  const FittedMotion motion = state.motion();
  const Motion m = motion.at(t_s);
  const RigConstants& c = state.constants;
  const Vec3 w = m.omega_B.cwiseQuotient(c.gyroscope_gain) + motion.gyroscope_bias(t_s);
  Vec3 f_B = m.R_WB.transpose() * (m.a_WB - c.g_T);
  const Vec3 alpha_B = motion.angular_acceleration(t_s);
  for (int i = 0; i < 3; ++i) {
    const Vec3 p_B = c.accelerometers_B.col(i);
    f_B[i] += (alpha_B.cross(p_B) + m.omega_B.cross(m.omega_B.cross(p_B)))[i];
  }
  return {t_s, w, f_B.cwiseQuotient(c.accelerometer_gain) + motion.accelerometer_bias(t_s)};
}

TEST(RigFactors, ReadingsHaveTheirDerivatives) {
  const RigReading reading = agreeing(state_of(CameraModel::kPinholeRadialTangential), 0.345);
  expect_derivatives([&](const RigFactors& f) { return f.gyroscope(reading, 1); });
  expect_derivatives([&](const RigFactors& f) { return f.accelerometer(reading, 1); });
}

TEST(RigFactors, ReadingsThatAgreeHaveNoResidual) {
  const RigState state = state_of(CameraModel::kPinholeRadialTangential);
  const RigLayout layout(state);
  const RigFactors factors(state, layout);
  const RigReading reading = agreeing(state, 0.678);
  EXPECT_LT(factors.gyroscope(reading, 1).e.norm(), 1e-12);
  EXPECT_LT(factors.accelerometer(reading, 1).e.norm(), 1e-11);
}

}  // namespace
}  // namespace epiline
