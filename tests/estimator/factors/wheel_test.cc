// Its gradient: gradient_test.cc. Derivation: docs/derivations/wheel.md.
#include "estimator/factors/wheel.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <memory>

#include "estimator/geometry/so3.h"
#include "tests/estimator/dense_algebra.h"
#include "tests/estimator/factors/named_blocks.h"
#include "tests/estimator/inertial/random_interval.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline::test {
namespace {

double sum(const WheelScale::Shares& share, const WheelScale::Shares& of) {
  double s = 0;
  for (std::size_t i = 0; i < share.size(); ++i) s += share[i] * of[i];
  return s;
}

// Against the covariance written out: noise, and a scale in common of which nothing is known.
RC_GTEST_PROP(WheelScale, InnovationsSayWhatAllWaysSay, (std::uint32_t seed)) {
  Random random(seed);
  const int n = 2 + static_cast<int>(seed % 8);
  Eigen::MatrixXd C(n, n);
  Eigen::VectorXd r(n), moved(n);
  WheelScale scale;
  WheelScale::Shares off{};
  double chi2 = 0;
  for (int i = 0; i < n; ++i) {  // from the newest on
    const int k = n - i;
    moved[i] = random.gaussian(1).x();
    r[i] = random.gaussian(0.1).x();
    off[static_cast<std::size_t>(k)] = r[i];
    const WheelScale::Innovation innovation = scale.add(k, moved[i], 1e-4);
    chi2 += std::pow(sum(innovation.share, off), 2) / innovation.variance;
  }
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) C(i, j) = (i == j ? 1e-4 : 0) + 9 * moved[i] * moved[j];
  const double written_out = r.dot(inverse(C) * r);
  RC_ASSERT(std::abs(chi2 - written_out) < 1e-4 * (1 + written_out));
}

/// Along x, by 0.2 m in each tenth of a second, of which the wheels read `scale`.
std::unique_ptr<Window> straight_window(double scale, double slip = 1, int slips_from = kMaxFrames) {
  auto window = std::make_unique<Window>(kMaxFrames);
  window->wheel.sigma_m_s = 0.05;
  for (int k = 0; k < 10; ++k) {
    Slot& s = window->append();
    s.x.p = Vec3(0.2 * k, 0, 0);
    s.x.v = Vec3(2, 0, 0);
    s.imu.T = 0.1;
    s.wheel = {.known = k > 0, .way = Vec3(0.2 * scale * (k >= slips_from ? slip : 1), 0, 0)};
    s.wheel.axis_s = Vec3(0.1, 0, 0);
    s.wheel.time_of_one_s2 = 0.01 * 0.1;
  }
  return window;
}
double cost(Window& w, bool oldest_only = false) {
  find_slips(w);
  return add_wheel(w, {w.size(), oldest_only}, nullptr);
}
/// The window's way times 1 + e.
void stretch(Window& w, double e) {
  for (int k = 0; k < w.size(); ++k) w.at(k).x.p *= 1 + e;
}

TEST(WheelFactor, ItsScaleIsKnownAsWellAsItIsSaidToBe) {
  const auto w = straight_window(1);
  EXPECT_NEAR(cost(*w), 0, 1e-12);
  stretch(*w, 0.03);
  EXPECT_NEAR(cost(*w), 4 * std::log1p(0.25), 0.1) << "one sigma of the scale, in all ten frames together";
  EXPECT_LT(cost(*w, true), 1e-3) << "of which nothing may become part of the prior";
}

// Else each frame that leaves would shrink the window a little, as the wheels' noise shrinks with it.
TEST(WheelFactor, TheirNoiseDoesNotShrinkTheWindow) {
  for (const double scale : {1.0, 3.6, -1.0}) {
    const auto w = straight_window(scale);
    Random random(2);
    for (int k = 1; k < w->size(); ++k) w->at(k).wheel.way.x() += 2e-3 * random.gaussian(1).x();
    const double before = cost(*w, true);
    NamedBlocks blocks;
    add_wheel(*w, {w->size(), true}, &blocks);
    double slope = 0;  // of the cost by the window's stretch
    for (int k = 0; k < w->size(); ++k) slope += blocks.slope(pose_of(k), 0) * w->at(k).x.p.x();
    EXPECT_GT(before, 0.01);
    EXPECT_LT(std::abs(slope), 0.01 * before) << scale;
  }
}

TEST(WheelFactor, SlipBeginsARunOfItsOwn) {
  const auto w = straight_window(1, 1.3, 7);
  find_slips(*w);
  for (int k = 1; k < w->size(); ++k) {
    EXPECT_EQ(w->at(k).wheel.slips, k == 6) << k;
    EXPECT_NEAR(w->at(k).wheel.scale, k >= 7 ? 1.3 : 1, 1e-2) << k;
  }
  const double slipping = add_wheel(*w, {w->size(), false}, nullptr);
  EXPECT_NEAR(slipping, 4 * std::log1p(25), 2) << "ten sigmas of a scale";
}

TEST(WheelFactor, SidewaysCountsIfItIsSaidTo) {
  const auto w = straight_window(1);
  for (int k = 0; k < w->size(); ++k) w->at(k).x.p.y() = 0.01 * k;
  EXPECT_NEAR(cost(*w), 0, 1e-12);
  w->wheel.sideways_sigma_m_s = 0.1;
  EXPECT_NEAR(cost(*w), 9 * 4 * std::log1p(0.25), 1e-9);
}

}  // namespace
}  // namespace epiline::test
