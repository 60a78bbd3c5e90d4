#include "drivers/laboratory/render/texture.h"

#include <gtest/gtest.h>

#include <cmath>

namespace epiline {
namespace {

const TextureAtlas& first_atlas() {
  static const TextureAtlas a(1);
  return a;
}

std::uint8_t texel(Material m, int level, int x, int y) {
  const int stride = TextureAtlas::size(level) + TextureAtlas::kRowPadding;
  return first_atlas().data()[first_atlas().offset(m) + TextureAtlas::level_offset(level) + y * stride + x];
}

class EveryMaterial : public testing::TestWithParam<int> {
 protected:
  Material material() const { return static_cast<Material>(GetParam()); }
};
INSTANTIATE_TEST_SUITE_P(Materials, EveryMaterial, testing::Range(0, static_cast<int>(Material::kCount)));

// Reading a little beyond a row gives its beginning: the texture has no seam.
TEST_P(EveryMaterial, RepeatsBeyondItsRows) {
  for (int level = 0; level < TextureAtlas::kLevels; ++level)
    for (int y = 0; y < TextureAtlas::size(level); ++y)
      for (int k = 0; k < TextureAtlas::kRowPadding; ++k)
        ASSERT_EQ(texel(material(), level, TextureAtlas::size(level) + k, y),
                  texel(material(), level, k % TextureAtlas::size(level), y));
}

// Across its border a texture changes no more than elsewhere.
TEST_P(EveryMaterial, HasNoSeam) {
  constexpr int n = TextureAtlas::size(0);
  double inside = 0, seam = 0;
  for (int y = 0; y < n; ++y) {
    seam += std::abs(texel(material(), 0, n - 1, y) - texel(material(), 0, 0, y));
    for (int x = 256; x < 264; ++x)
      inside += std::abs(texel(material(), 0, x, y) - texel(material(), 0, x + 1, y)) / 8.0;
  }
  // Plates and planks begin at the border: there a joint may lie.
  EXPECT_LT(seam / n, 3 * inside / n + 90);
}

// Every level is the mean of the one before; the last one's mean is the material's.
TEST_P(EveryMaterial, LevelsAreMeans) {
  double finest = 0;
  constexpr int n = TextureAtlas::size(0);
  for (int y = 0; y < n; ++y)
    for (int x = 0; x < n; ++x) finest += texel(material(), 0, x, y);
  EXPECT_NEAR(first_atlas().mean(material()), finest / (n * n), 1.0);
  EXPECT_GT(first_atlas().mean(material()), 15);
  EXPECT_LT(first_atlas().mean(material()), 200);
}

// A blank wall is nearly so; gravel is rough at every scale.
TEST(Texture, MaterialsDiffer) {
  const auto contrast = [](Material m, int level) {
    double sum = 0, sum2 = 0;
    const int n = TextureAtlas::size(level);
    for (int y = 0; y < n; ++y)
      for (int x = 0; x < n; ++x) {
        sum += texel(m, level, x, y);
        sum2 += static_cast<double>(texel(m, level, x, y)) * texel(m, level, x, y);
      }
    const double mean = sum / (n * n);
    return std::sqrt(sum2 / (n * n) - mean * mean) / mean;
  };
  EXPECT_LT(contrast(Material::kPaint, 0), 0.06);
  EXPECT_GT(contrast(Material::kGravel, 0), 0.12);
  EXPECT_GT(contrast(Material::kGravel, 2), 0.07);
  EXPECT_GT(contrast(Material::kPosters, 0), 0.15);
}

}  // namespace
}  // namespace epiline
