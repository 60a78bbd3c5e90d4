#include "platform/math/atmosphere.h"

#include <gtest/gtest.h>

namespace epiline {
namespace {

TEST(HeightBetween, IsThatOfTheStandardAtmosphere) {
  // its tables: 1013.25 hPa at 0 m, 1001.29 at 100 m, 954.61 at 500 m
  EXPECT_NEAR(height_between(1013.25, 1001.29, 15), 100, 0.3);
  EXPECT_NEAR(height_between(1013.25, 954.61, 15), 500, 4);
  EXPECT_NEAR(height_between(1001.29, 1013.25, 15), -100, 0.3);
  EXPECT_NEAR(height_between(1013.25, 1001.29, 45) / height_between(1013.25, 1001.29, 15), 318.15 / 288.15, 1e-12);
}

}  // namespace
}  // namespace epiline
