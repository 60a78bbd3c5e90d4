#include "drivers/laboratory/render/texture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "drivers/flights/motion/random.h"

namespace epiline {
namespace {

constexpr int kSize = TextureAtlas::size(0);
constexpr int kMask = kSize - 1;

/// A square image of reflectances, 0 to 1, that continues at the opposite side.
class Canvas {
 public:
  explicit Canvas(float value) : pixels_(static_cast<std::size_t>(kSize) * kSize, value) {}
  float& at(int x, int y) { return pixels_[static_cast<std::size_t>(y & kMask) * kSize + (x & kMask)]; }
  float at(int x, int y) const { return pixels_[static_cast<std::size_t>(y & kMask) * kSize + (x & kMask)]; }

  /// Calls f(pixel, x, y) for the pixels of a rectangle, which may cross the border.
  template <class F>
  void rectangle(int x0, int y0, int width, int height, F f) {
    for (int y = y0; y < y0 + height; ++y)
      for (int x = x0; x < x0 + width; ++x) f(at(x, y), x - x0, y - y0);
  }
  float mean() const {
    return static_cast<float>(std::accumulate(pixels_.begin(), pixels_.end(), 0.0) /
                              static_cast<double>(pixels_.size()));
  }
  void fill(int x0, int y0, int width, int height, float value) {
    rectangle(x0, y0, width, height, [value](float& p, int, int) { p = value; });
  }
  void disc(int cx, int cy, int radius, float value) {
    rectangle(cx - radius, cy - radius, 2 * radius + 1, 2 * radius + 1, [=](float& p, int x, int y) {
      if ((x - radius) * (x - radius) + (y - radius) * (y - radius) <= radius * radius) p = value;
    });
  }

 private:
  std::vector<float> pixels_;
};

/// Adds smooth noise of standard deviation about `sigma` with `nx` x `ny` cells (powers of two) over the image.
void add_noise(Canvas& canvas, int nx, int ny, double sigma, Random& random) {
  std::vector<float> grid(static_cast<std::size_t>(nx) * ny);
  for (float& g : grid) g = static_cast<float>(1.5 * sigma * random.normal());  // the interpolation averages
  const int step_x = kSize / nx, step_y = kSize / ny;
  const auto smooth = [](float t) { return t * t * (3 - 2 * t); };
  std::vector<float> weight(static_cast<std::size_t>(std::max(step_x, step_y)));
  for (int y = 0; y < kSize; ++y) {
    const int gy = y / step_y, gy1 = (gy + 1) % ny;
    const float fy = smooth(static_cast<float>(y % step_y) / static_cast<float>(step_y));
    for (int x = 0; x < kSize; ++x) {
      const int gx = x / step_x, gx1 = (gx + 1) % nx;
      const float fx = smooth(static_cast<float>(x % step_x) / static_cast<float>(step_x));
      const float top =
          grid[static_cast<std::size_t>(gy) * nx + gx] * (1 - fx) + grid[static_cast<std::size_t>(gy) * nx + gx1] * fx;
      const float low = grid[static_cast<std::size_t>(gy1) * nx + gx] * (1 - fx) +
                        grid[static_cast<std::size_t>(gy1) * nx + gx1] * fx;
      canvas.at(x, y) += top * (1 - fy) + low * fy;
    }
  }
}

/// Octaves from `first` cells a side to `last`, each `falloff` times as strong as the one before.
void add_octaves(Canvas& canvas, int first, int last, double sigma, double falloff, Random& random) {
  for (int n = first; n <= last; n *= 2, sigma *= falloff) add_noise(canvas, n, n, sigma, random);
}

int draw(Random& random, int low, int high) { return static_cast<int>(random.uniform(low, high + 1)); }
float draw(Random& random, double low, double high) { return static_cast<float>(random.uniform(low, high)); }

void add_specks(Canvas& canvas, int count, int radius, double low, double high, Random& random) {
  for (int i = 0; i < count; ++i)
    canvas.disc(draw(random, 0, kMask), draw(random, 0, kMask), draw(random, 0, radius), draw(random, low, high));
}

/// A scratch or crack: a random walk.
void add_scratches(Canvas& canvas, int count, int length, double low, double high, Random& random) {
  for (int i = 0; i < count; ++i) {
    double x = random.uniform(0, kSize), y = random.uniform(0, kSize), angle = random.uniform(0, 6.28);
    const float value = draw(random, low, high);
    for (int k = draw(random, length / 4, length); k > 0; --k) {
      canvas.at(static_cast<int>(x), static_cast<int>(y)) = value;
      x += std::cos(angle);
      y += std::sin(angle);
      angle += 0.12 * random.normal();
    }
  }
}

/// Lines of something like print.
void add_print(Canvas& canvas, int x0, int y0, int width, int height, int line, Random& random) {
  const float ink = draw(random, 0.03, 0.25);
  for (int y = y0 + line; y + line < y0 + height; y += 2 * line) {
    for (int x = x0 + line; x < x0 + width - line;) {
      const int word = draw(random, line / 2, 3 * line);
      if (random.chance(0.85) && x + word < x0 + width - line) canvas.fill(x, y, word, line, ink);
      x += word + draw(random, line / 3, line);
    }
  }
}

Canvas paint(Random& random) {
  Canvas c(0.55F);
  add_octaves(c, 2, 8, 0.03, 0.6, random);
  add_octaves(c, 64, 512, 0.006, 0.9, random);
  add_scratches(c, 6, 120, 0.35, 0.45, random);
  add_specks(c, 12, 3, 0.2, 0.4, random);
  return c;
}

Canvas concrete(Random& random) {
  Canvas c(0.42F);
  add_octaves(c, 2, 512, 0.07, 0.78, random);
  add_specks(c, 500, 4, 0.12, 0.3, random);
  add_scratches(c, 14, 500, 0.1, 0.2, random);
  return c;
}

Canvas brick(Random& random) {
  Canvas c(0.6F);  // mortar
  constexpr int kWidth = 64, kHeight = 32, kJoint = 4;
  for (int row = 0; row < kSize / kHeight; ++row) {
    for (int i = 0; i < kSize / kWidth; ++i) {
      const float value = draw(random, 0.18, 0.42);
      c.fill(i * kWidth + (row % 2) * kWidth / 2, row * kHeight, kWidth - kJoint, kHeight - kJoint, value);
    }
  }
  add_octaves(c, 8, 512, 0.03, 0.85, random);
  add_specks(c, 300, 3, 0.08, 0.5, random);
  return c;
}

Canvas wood(Random& random) {
  Canvas c(0.5F);
  constexpr int kPlank = 128;
  for (int y = 0; y < kSize; y += kPlank) {
    const float value = draw(random, -0.12, 0.12);
    c.rectangle(0, y, kSize, kPlank, [value](float& p, int, int) { p += value; });
  }
  for (int n = 64; n <= 512; n *= 2) add_noise(c, n / 32, n, 0.05, random);  // grain runs along x
  add_octaves(c, 64, 512, 0.02, 0.9, random);
  for (int i = 0; i < 40; ++i) {  // knots and nail heads
    const int x = draw(random, 0, kMask), y = draw(random, 0, kMask), r = draw(random, 2, 11);
    c.disc(x, y, r, draw(random, 0.12, 0.3));
    c.disc(x + 1, y, r / 2, draw(random, 0.05, 0.2));
  }
  for (int y = 0; y < kSize; y += kPlank) {
    c.fill(0, y, kSize, 5, 0.05F);
    c.fill(draw(random, 0, kMask), y, 5, kPlank, 0.05F);
  }
  return c;
}

Canvas metal(Random& random) {
  Canvas c(0.4F);
  constexpr int kPlate = 256;
  for (int y = 0; y < kSize; y += kPlate) {
    for (int x = 0; x < kSize; x += kPlate) {
      const float value = draw(random, 0.15, 0.65);
      c.fill(x, y, kPlate, kPlate, value);
      c.fill(x, y, kPlate, 3, 0.08F);
      c.fill(x, y, 3, kPlate, 0.08F);
      for (int k = 16; k < kPlate; k += 32) {
        c.disc(x + k, y + 12, 4, 0.85F);
        c.disc(x + 12, y + k, 4, 0.1F);
      }
    }
  }
  for (int n = 8; n <= 256; n *= 2) add_noise(c, n, n / 8, 0.03, random);  // brushed
  add_scratches(c, 60, 160, 0.6, 0.95, random);
  add_octaves(c, 64, 512, 0.012, 0.9, random);
  return c;
}

Canvas posters(Random& random) {
  Canvas c(0.5F);
  add_octaves(c, 2, 512, 0.03, 0.8, random);
  for (int i = 0; i < 26; ++i) {
    const int w = draw(random, 60, 220), h = draw(random, 60, 260), x = draw(random, 0, kMask),
              y = draw(random, 0, kMask);
    c.fill(x, y, w, h, draw(random, 0.5, 0.95));
    if (random.chance(0.6)) {
      add_print(c, x, y, w, h, draw(random, 3, 9), random);
    } else {
      for (int k = 0; k < 14; ++k) {
        const int pw = draw(random, 6, w / 2), ph = draw(random, 6, h / 2);
        c.fill(x + draw(random, 0, w - pw), y + draw(random, 0, h - ph), pw, ph, draw(random, 0.03, 0.95));
      }
    }
  }
  add_octaves(c, 128, 512, 0.012, 0.9, random);
  return c;
}

Canvas tiles(Random& random) {
  Canvas c(0.2F);
  constexpr int kTile = 128, kJoint = 5;
  for (int y = 0; y < kSize; y += kTile) {
    for (int x = 0; x < kSize; x += kTile) {
      const bool dark = ((x / kTile + y / kTile) % 2) != 0;
      c.fill(x, y, kTile - kJoint, kTile - kJoint, (dark ? 0.3F : 0.5F) + draw(random, -0.05, 0.05));
    }
  }
  add_octaves(c, 4, 512, 0.03, 0.8, random);
  add_specks(c, 250, 3, 0.08, 0.3, random);
  add_scratches(c, 12, 200, 0.12, 0.25, random);
  return c;
}

Canvas mesh(Random& random) {
  Canvas c(0.08F);
  add_octaves(c, 4, 64, 0.02, 0.8, random);
  constexpr int kPitch = 32;
  for (int k = 0; k < kSize; k += kPitch) {
    c.rectangle(0, k, kSize, 6, [&](float& p, int, int) { p = 0.55F; });
    c.rectangle(k, 0, 6, kSize, [&](float& p, int, int) { p = 0.6F; });
  }
  add_octaves(c, 64, 512, 0.04, 0.9, random);
  return c;
}

Canvas gravel(Random& random) {
  Canvas c(0.35F);
  add_octaves(c, 2, 16, 0.04, 0.8, random);
  for (int i = 0; i < 9000; ++i)
    c.disc(draw(random, 0, kMask), draw(random, 0, kMask), draw(random, 1, 8), draw(random, 0.12, 0.65));
  add_octaves(c, 128, 512, 0.04, 0.9, random);
  return c;
}

Canvas grass(Random& random) {
  Canvas c(0.28F);
  add_octaves(c, 4, 512, 0.045, 0.95, random);
  for (int i = 0; i < 5000; ++i) {
    double x = random.uniform(0, kSize), y = random.uniform(0, kSize);
    const double dx = 0.7 * random.normal();
    const float value = draw(random, 0.1, 0.55);
    for (int k = draw(random, 6, 24); k > 0; --k, x += dx, y += 1)
      c.at(static_cast<int>(x), static_cast<int>(y)) = value;
  }
  return c;
}

Canvas facade(Random& random) {
  Canvas c(0.5F);
  add_octaves(c, 2, 256, 0.04, 0.8, random);
  constexpr int kStorey = 128, kAxis = 128;
  for (int y = 0; y < kSize; y += kStorey) {
    for (int x = 0; x < kSize; x += kAxis) {
      const int w = 60, h = 76;
      c.fill(x + 30, y + 24, w + 8, h + 8, 0.75F);
      c.fill(x + 34, y + 28, w, h, draw(random, 0.04, 0.3));
      c.fill(x + 34 + w / 2 - 2, y + 28, 4, h, 0.7F);
      if (random.chance(0.3)) c.fill(x + 34, y + 28, w, draw(random, 10, h), draw(random, 0.4, 0.8));
    }
    c.fill(0, y, kSize, 6, 0.35F);
  }
  add_octaves(c, 128, 512, 0.02, 0.9, random);
  return c;
}

Canvas machine(Random& random) {
  Canvas c(0.25F);
  for (int i = 0; i < 60; ++i) {
    const int w = draw(random, 40, 260), h = draw(random, 40, 200), x = draw(random, 0, kMask),
              y = draw(random, 0, kMask);
    const float value = draw(random, 0.08, 0.6);
    c.fill(x, y, w, h, 0.5F * value);
    c.fill(x + 3, y + 3, w - 6, h - 6, value);
    const int kind = draw(random, 0, 4);
    if (kind == 0) {  // vent
      for (int k = 10; k < h - 10; k += 12) c.fill(x + 10, y + k, w - 20, 5, 0.04F);
    } else if (kind == 1) {  // knobs
      for (int k = 14; k < w - 14; k += 26) c.disc(x + k, y + h / 2, 7, draw(random, 0.05, 0.9));
    } else if (kind == 2) {
      add_print(c, x, y, w, std::min(h, 60), 5, random);
    } else if (kind == 3) {  // screws
      for (const int sx : {8, w - 9})
        for (const int sy : {8, h - 9}) c.disc(x + sx, y + sy, 3, 0.85F);
    }
  }
  add_octaves(c, 16, 512, 0.015, 0.95, random);
  add_scratches(c, 40, 120, 0.5, 0.8, random);
  return c;
}

Canvas ribs(Random& random) {
  Canvas c(0.4F);
  for (int x = 0; x < kSize; ++x) {
    const float value = 0.16F * std::sin(static_cast<float>(x) * 6.2831853F / 64);
    c.rectangle(x, 0, 1, kSize, [value](float& p, int, int) { p += value; });
  }
  add_octaves(c, 2, 512, 0.035, 0.8, random);
  for (int k = 0; k < 50; ++k)
    c.disc(draw(random, 0, 15) * 64, draw(random, 0, kMask), draw(random, 2, 6), draw(random, 0.05, 0.9));
  return c;
}

Canvas landscape(Random& random) {
  Canvas c(0.4F);
  add_octaves(c, 4, 512, 0.09, 0.8, random);
  for (int i = 0; i < 900; ++i) {  // crowns of trees
    const int x = draw(random, 0, kMask), y = draw(random, 0, kMask), r = draw(random, 3, 16);
    c.disc(x, y, r, draw(random, 0.08, 0.3));
    c.disc(x - r / 3, y - r / 3, r / 2, draw(random, 0.2, 0.45));
  }
  for (int i = 0; i < 60; ++i)  // houses
    c.fill(draw(random, 0, kMask), draw(random, 0, kMask), draw(random, 6, 24), draw(random, 5, 16),
           draw(random, 0.5, 0.9));
  add_octaves(c, 128, 512, 0.02, 0.9, random);
  return c;
}

using Painter = Canvas (*)(Random&);
constexpr std::array<Painter, static_cast<std::size_t>(Material::kCount)> kPainters{
    paint, concrete, brick, wood, metal, posters, tiles, mesh, gravel, grass, facade, machine, ribs, landscape};

/// Real surfaces have less contrast than their painters; chosen so that images have the gradients of EuRoC's.
constexpr float kContrast = 0.5F;

/// Level 0 with its padded rows.
void store(const Canvas& canvas, std::uint8_t* out) {
  const float mean = canvas.mean();
  for (int y = 0; y < kSize; ++y)
    for (int x = 0; x < kSize + TextureAtlas::kRowPadding; ++x)
      *out++ = static_cast<std::uint8_t>(
          std::lround(255 * std::clamp(mean + kContrast * (canvas.at(x, y) - mean), 0.0F, 1.0F)));
}

/// The next level: means of 2x2 texels.
void halve(const std::uint8_t* in, int size_in, std::uint8_t* out) {
  const int stride = size_in + TextureAtlas::kRowPadding, size_out = size_in / 2;
  for (int y = 0; y < size_out; ++y) {
    const std::uint8_t* top = in + static_cast<std::ptrdiff_t>(2 * y) * stride;
    for (int x = 0; x < size_out + TextureAtlas::kRowPadding; ++x) {
      const std::uint8_t* p = top + 2 * (x % size_out);
      // Rounding halves up everywhere would brighten each level by an eighth.
      *out++ = static_cast<std::uint8_t>((p[0] + p[1] + p[stride] + p[stride + 1] + 1 + (x + y) % 2) / 4);
    }
  }
}

}  // namespace

TextureAtlas::TextureAtlas(std::uint64_t seed) {
  static_assert(kBytes == level_offset(kLevels));
  data_.resize(static_cast<std::size_t>(kBytes) * kPainters.size());
  for (std::size_t i = 0; i < kPainters.size(); ++i) {
    Random random(seed, 1000 + i);
    std::uint8_t* base = data_.data() + i * kBytes;
    store(kPainters[i](random), base);
    for (int l = 1; l < kLevels; ++l) halve(base + level_offset(l - 1), size(l - 1), base + level_offset(l));
  }
}

double TextureAtlas::mean(Material material) const {
  const std::uint8_t* last = data_.data() + offset(material) + level_offset(kLevels - 1);
  double sum = 0;
  for (int y = 0; y < size(kLevels - 1); ++y)
    for (int x = 0; x < size(kLevels - 1); ++x) sum += last[y * (size(kLevels - 1) + kRowPadding) + x];
  return sum / (size(kLevels - 1) * size(kLevels - 1));
}

}  // namespace epiline
