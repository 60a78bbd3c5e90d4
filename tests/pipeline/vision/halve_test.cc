#include "pipeline/vision/halve.h"

#include <gtest/gtest.h>

#include <set>

#include "pipeline/vision/pyramid.h"
#include "tests/pipeline/vision/support.h"

namespace epiline {
namespace {

TestImage halved(const TestImage& in, int out_stride) {
  TestImage out(in.width / 2, in.height / 2, out_stride);
  halve(in.view(), out.pixels.data(), out.stride);
  return out;
}

TEST(Halve, IsTheRoundedMeanOfFourAtEverySize) {
  std::mt19937 random(1);
  on_every_target([&] {
    for (int width = 64; width <= 200; ++width) {
      const TestImage in = random_image(width, 2 + width % 7, random, width + width % 5);
      const TestImage out = halved(in, width / 2 + 3);
      for (int y = 0; y < out.height; ++y) {
        for (int x = 0; x < out.width; ++x) {
          const int sum =
              in.at(2 * x, 2 * y) + in.at(2 * x + 1, 2 * y) + in.at(2 * x, 2 * y + 1) + in.at(2 * x + 1, 2 * y + 1);
          ASSERT_EQ(out.at(x, y), (sum + 2) / 4) << "width " << width << " at " << x << ", " << y;
        }
        for (int x = out.width; x < out.stride; ++x) ASSERT_EQ(out.at(x, y), 0) << "wrote past the row";
      }
    }
  });
}

TEST(Halve, EveryInstructionSetOfTheMachineIsTested) {
  std::set<std::string> seen;
  on_every_target([&] { seen.insert(simd_target()); });
  EXPECT_TRUE(seen.contains(simd_target())) << "the set used outside tests is not among those tested";
}

TEST(Pyramid, HasLevelsDownTo32Pixels) {
  EXPECT_EQ(Pyramid(752, 480, 4).view().levels, 4);
  EXPECT_EQ(Pyramid(752, 480, 6).view().levels, 4);  // 480 / 16 = 30
  EXPECT_EQ(Pyramid(64, 64, 4).view().levels, 2);
  EXPECT_EQ(Pyramid(63, 480, 4).view().levels, 1);
  EXPECT_EQ(Pyramid(2048, 1536, 6).view().levels, 6);
}

TEST(Pyramid, LeavesLevelZeroInPlaceAndPadsTheRest) {
  std::mt19937 random(3);
  const TestImage image = random_image(641, 479, random, 650);
  Pyramid pyramid(641, 479, 4);
  pyramid.build(image.view());
  EXPECT_EQ(pyramid.view().level[0].data, image.pixels.data());
  EXPECT_EQ(pyramid.view().level[0].stride, 650);
  for (int l = 1; l < 4; ++l) {
    const ImageView& level = pyramid.view().level[l];
    EXPECT_EQ(level.width, 641 >> l);
    EXPECT_EQ(level.height, 479 >> l);
    EXPECT_EQ(level.stride % 64, 0);
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(level.data) % 64, 0u);
  }
}

// A ramp shows where the centre of a coarse pixel lies: x_coarse = (x + 0.5) / 2 - 0.5 at each level.
TEST(Pyramid, CentresFollowTheRule) {
  TestImage ramp(256, 256);
  ramp.fill([](int x, int) { return x; });
  Pyramid pyramid(256, 256, 4);
  pyramid.build(ramp.view());
  for (int l = 1; l < 4; ++l) {
    const ImageView& level = pyramid.view().level[l];
    for (int x = 0; x < level.width; ++x) {
      const double fine = (x + 0.5) * (1 << l) - 0.5;
      ASSERT_NEAR(level.row(5)[x], fine, 0.5 + 1e-9) << "level " << l << " at " << x;
    }
  }
}

}  // namespace
}  // namespace epiline
