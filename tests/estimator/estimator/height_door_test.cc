// Which heights the estimator lets in. What it makes of them: tests/flights/height_test.cc.
#include <gtest/gtest.h>

#include <limits>

#include "estimator/estimator.h"

namespace epiline {
namespace {

HeightSample height(HeightKind kind, std::int64_t ms, double metres) {
  return {HostStamp{ms * 1'000'000}, kind, metres};
}

TEST(HeightDoor, LetsInWhatIsLaterAndWithinTheRange) {
  EstimatorConfig config;
  config.heights[1].limits_m[1] = 60;
  Estimator estimator(config);
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  for (const HeightKind kind : {HeightKind::kBarometer, HeightKind::kRangeFinder}) {
    EXPECT_TRUE(estimator.add_height(height(kind, 100, 50)));
    EXPECT_FALSE(estimator.add_height(height(kind, 100, 51)));
    EXPECT_FALSE(estimator.add_height(height(kind, 90, 51)));
    for (const double metres : {nan, inf, -inf, 1e9}) EXPECT_FALSE(estimator.add_height(height(kind, 200, metres)));
    EXPECT_TRUE(estimator.add_height(height(kind, 200, 51)));
  }
  EXPECT_FALSE(estimator.add_height(height(HeightKind::kRangeFinder, 300, 61)));
  EXPECT_FALSE(estimator.add_height(height(HeightKind::kRangeFinder, 300, 0.01)));
  EXPECT_TRUE(estimator.add_height(height(HeightKind::kBarometer, 300, -20)));
  const EstimatorStats& stats = estimator.stats();
  EXPECT_EQ(stats.height_samples[0], 3u);
  EXPECT_EQ(stats.height_samples[1], 2u);
  EXPECT_EQ(stats.height_refused[0], 6u);
  EXPECT_EQ(stats.height_refused[1], 8u);
}

TEST(HeightDoor, IsClosedToASensorThatIsNotToBeUsed) {
  EstimatorConfig config;
  config.heights[0].use = false;
  Estimator estimator(config);
  EXPECT_FALSE(estimator.add_height(height(HeightKind::kBarometer, 100, 50)));
  EXPECT_TRUE(estimator.add_height(height(HeightKind::kRangeFinder, 100, 50)));
}

}  // namespace
}  // namespace epiline
