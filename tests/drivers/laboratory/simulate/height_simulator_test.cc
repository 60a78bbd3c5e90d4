#include "drivers/laboratory/simulate/height_simulator.h"

#include <gtest/gtest.h>

#include <cmath>

#include "estimator/geometry/so3.h"

namespace epiline {
namespace {

/// Stands at a place, leaning.
class Leaning final : public MotionModel {
 public:
  Leaning(const Vec3& p, double lean_rad) {
    motion_ = {p, Vec3::Zero(), Vec3::Zero(), so3_exp(Vec3(lean_rad, 0, 0)), Vec3::Zero()};
  }
  Motion at(double) const override { return motion_; }
  double duration_s() const override { return 100; }

 private:
  Motion motion_;
};

double spread(const std::vector<HeightSample>& samples) {
  double sum = 0, squares = 0;
  const auto n = static_cast<double>(samples.size());
  for (const HeightSample& s : samples) {
    sum += s.metres;
    squares += s.metres * s.metres;
  }
  return std::sqrt(squares / n - sum * sum / (n * n));
}

TEST(HeightSimulator, ABarometerHasItsNoise) {
  const Leaning motion({0, 0, 30}, 0);
  BarometerSimulation barometer{.rate_hz = 50, .sigma_m = 0.2, .walk = 0, .gust_m = 0};
  EXPECT_NEAR(spread(simulate_barometer(motion, {}, barometer, 1)), 0.2, 0.02);
  barometer = {.rate_hz = 50, .sigma_m = 0, .walk = 0, .gust_m = 0.5, .gust_s = 0.5};
  EXPECT_NEAR(spread(simulate_barometer(motion, {}, barometer, 1)), 0.5, 0.1);
  // the mean square of the steps of a walk does not depend on where it gets
  barometer = {.rate_hz = 50, .sigma_m = 0, .walk = 0.1, .gust_m = 0};
  const auto walk = simulate_barometer(motion, {}, barometer, 1);
  double squares = 0;
  for (std::size_t i = 1; i < walk.size(); ++i) squares += std::pow(walk[i].metres - walk[i - 1].metres, 2);
  EXPECT_NEAR(squares / 100, 0.01, 0.001);
}

TEST(HeightSimulator, ABarometerJumpsWhenTold) {
  const Leaning motion({0, 0, 30}, 0);
  const auto samples = simulate_barometer(
      motion, HostStamp{7}, {.rate_hz = 10, .sigma_m = 0, .walk = 0, .gust_m = 0, .jump_m = 5, .jump_at_s = 50}, 3);
  ASSERT_EQ(samples.size(), 1001u);
  EXPECT_EQ(samples[500].stamp.ns, 7 + 50'000'000'000);
  EXPECT_DOUBLE_EQ(samples[499].metres, samples[0].metres);
  EXPECT_NEAR(samples[500].metres - samples[499].metres, 5, 1e-12);
}

TEST(HeightSimulator, ALeaningRangeFinderMeasuresAlongItsBeam) {
  const RangeSimulation perfect{.sigma_m = 0, .drop_share = 0};
  const auto samples = simulate_range(Leaning({0, 0, 10}, 0.5), {}, flat_ground(-2), perfect, 1);
  ASSERT_EQ(samples.size(), 2001u);
  EXPECT_NEAR(samples[7].metres, 12 / std::cos(0.5), 1e-12);
  EXPECT_TRUE(simulate_range(Leaning({0, 0, 10}, 3), {}, flat_ground(-2), perfect, 1).empty()) << "it looks up";
  EXPECT_TRUE(simulate_range(Leaning({0, 0, 300}, 0), {}, flat_ground(-2), perfect, 1).empty()) << "too far";
}

TEST(HeightSimulator, ARangeFinderLosesSamplesAndSeesSteps) {
  const auto samples = [](double x, const RangeSimulation& range) {
    return simulate_range(Leaning({x, 0, 10}, 0), {}, flat_ground(0), range, 1);
  };
  EXPECT_NEAR(static_cast<double>(samples(0, {.drop_share = 0.25}).size()), 1500, 80);
  const RangeSimulation steps{.sigma_m = 0, .drop_share = 0, .step_m = 2, .step_every_m = 50};
  EXPECT_DOUBLE_EQ(samples(49, steps)[0].metres, 10);
  EXPECT_DOUBLE_EQ(samples(51, steps)[0].metres, 8);
  EXPECT_DOUBLE_EQ(samples(101, steps)[0].metres, 10);
  EXPECT_DOUBLE_EQ(samples(-1, steps)[0].metres, 8);
}

}  // namespace
}  // namespace epiline
