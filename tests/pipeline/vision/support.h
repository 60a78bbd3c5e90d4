#pragma once
// What the tests of the image kernels share: owned images, textures with known sub-pixel shifts, every instruction set.
#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "pipeline/vision/image_view.h"
#include "pipeline/vision/klt.h"
#include "platform/samples/samples.h"

namespace epiline {

/// An 8-bit image of its own, as tightly packed as its stride says: the address sanitizer sees every byte read beyond
/// it.
struct TestImage {
  TestImage(int w, int h, int row_stride = 0)
      : width(w), height(h), stride(row_stride ? row_stride : w), pixels(static_cast<std::size_t>(stride) * h) {}
  std::uint8_t& at(int x, int y) { return pixels[static_cast<std::size_t>(y) * stride + x]; }
  int at(int x, int y) const { return pixels[static_cast<std::size_t>(y) * stride + x]; }
  ImageView view() const { return {pixels.data(), width, height, stride}; }
  void fill(const std::function<double(int, int)>& grey) {
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x)
        at(x, y) = static_cast<std::uint8_t>(std::clamp(std::lround(grey(x, y)), 0L, 255L));
    }
  }

  int width, height, stride;
  std::vector<std::uint8_t> pixels;
};

inline TestImage random_image(int width, int height, std::mt19937& random, int stride = 0) {
  TestImage image(width, height, stride);
  std::uniform_int_distribution<int> grey(0, 255);
  for (auto& p : image.pixels) p = static_cast<std::uint8_t>(grey(random));
  return image;
}

/// Images are 50 ms apart.
inline Frame frame_of(const TestImage& image, int number) {
  return {HostStamp{50'000'000LL * number},
          static_cast<std::uint64_t>(number),
          image.pixels.data(),
          image.width,
          image.height,
          image.stride};
}

/// A sum of plane waves: known at every real position, so that shifts are exact but for the rounding of grey values.
class Waves {
 public:
  explicit Waves(unsigned seed, double shortest_px = 7, double longest_px = 60) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> unit(0, 1);
    for (Wave& w : waves_) {
      const double length = shortest_px * std::pow(longest_px / shortest_px, unit(random));
      const double angle = 2 * std::numbers::pi * unit(random);
      w = {2 * std::numbers::pi / length * std::cos(angle), 2 * std::numbers::pi / length * std::sin(angle),
           2 * std::numbers::pi * unit(random), 10 * std::sqrt(length / longest_px) + 4};
    }
  }
  double operator()(double x, double y) const {
    double grey = 128;
    for (const Wave& w : waves_) grey += w.amplitude * std::sin(w.kx * x + w.ky * y + w.phase);
    return grey;
  }

  /// The same on the grid (x - dx, y - dy), by the angle sum formula: sines for columns and rows only.
  TestImage image(int width, int height, double dx, double dy, double gain, double bias) const {
    std::vector<double> grey(static_cast<std::size_t>(width) * height, 128);
    std::vector<double> s(static_cast<std::size_t>(width)), c(s.size());
    for (const Wave& w : waves_) {
      for (int x = 0; x < width; ++x) {
        s[x] = w.amplitude * std::sin(w.kx * (x - dx) + w.phase);
        c[x] = w.amplitude * std::cos(w.kx * (x - dx) + w.phase);
      }
      for (int y = 0; y < height; ++y) {
        const double sy = std::sin(w.ky * (y - dy)), cy = std::cos(w.ky * (y - dy));
        double* row = grey.data() + static_cast<std::ptrdiff_t>(y) * width;
        for (int x = 0; x < width; ++x) row[x] += s[x] * cy + c[x] * sy;
      }
    }
    TestImage image(width, height);
    image.fill([&](int x, int y) { return gain * grey[static_cast<std::size_t>(y) * width + x] + bias; });
    return image;
  }

 private:
  struct Wave {
    double kx, ky, phase, amplitude;
  };
  Wave waves_[24];
};

/// The world moved by (dx, dy) px to the right and down.
inline TestImage shifted(const Waves& waves, int width, int height, double dx, double dy, double gain = 1,
                         double bias = 0) {
  return waves.image(width, height, dx, dy, gain, bias);
}

/// Runs `test` with each instruction set that this machine and the build have.
inline void on_every_target(const std::function<void()>& test) {
  const auto choose = [](std::int64_t targets) {
    hwy::SetSupportedTargetsForTest(targets);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  };
  const std::int64_t all = hwy::SupportedTargets();
  for (std::int64_t rest = all; rest != 0; rest &= rest - 1) {
    const std::int64_t target = rest & -rest;
    choose(target);
    if (simd_target() != std::string(hwy::TargetName(target))) continue;  // not in this build
    SCOPED_TRACE(simd_target());
    test();
  }
  choose(0);
}

}  // namespace epiline
