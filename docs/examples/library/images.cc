// Images in, odometry out, in C++: a robot rests for a second, then swings from side to side in front of a painted
// wall. Each second the program prints the true and the estimated position. Replace samples and images by those of your
// IMU and camera.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <random>
#include <vector>

#include "pipeline/library/odometer.h"

using namespace epiline;

/// Position to the left, m, and its second derivative.
double left(double t) { return t < 1 ? 0 : 0.5 * std::pow(std::sin(t - 1), 2); }
double acceleration(double t) { return t < 1 ? 0 : std::cos(2 * (t - 1)); }

/// Paint of the wall: a random grey at each corner of a grid, and what lies between them.
double paint(double x, double y) {
  const auto corner = [](double i, double j) {
    return std::fmod(std::abs(std::sin(12.9898 * i + 78.233 * j)) * 43758.5453, 1);
  };
  const double i = std::floor(x), j = std::floor(y), u = x - i, v = y - j;
  return (1 - v) * ((1 - u) * corner(i, j) + u * corner(i + 1, j)) +
         v * ((1 - u) * corner(i, j + 1) + u * corner(i + 1, j + 1));
}

int main() {
  OfflineSettings settings;
  settings.camera = {.width = 640, .height = 480, .intrinsics = {400, 400, 320, 240}};
  // the camera looks along the body's x axis; y points left
  settings.estimator.extrinsics.R_BC << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  settings.estimator.extrinsics.focal_px = 400;
  Odometer odometer(settings);

  std::vector<std::uint8_t> pixels(640 * 480);
  std::minstd_rand noise;  // the same image or sample again and again would count as a sensor that is stuck
  double error = 1;
  for (int ms = 0; ms <= 10'000; ms += 5) {
    const double t = 1e-3 * ms;
    const HostStamp stamp{ms * 1'000'000LL};
    const double grain = 1e-3 * (noise() % 20);
    if (!odometer.push_imu({.stamp = stamp, .specific_force_m_s2 = {grain, acceleration(t), 9.81}})) return 1;
    if (ms % 50 == 0) {
      for (int y = 0; y < 480; ++y)  // the wall is 3 m away
        for (int x = 0; x < 640; ++x)
          pixels[640 * y + x] = 250 * paint((x - 400 * left(t) / 3) / 12, y / 12.0) + noise() % 5;
      if (!odometer.push_image({.stamp = stamp, .data = pixels.data(), .width = 640, .height = 480, .stride = 640}))
        return 1;
    }
    while (odometer.step()) {
      const Odometry& o = odometer.outcome().odometry;
      const std::int64_t ns = odometer.outcome().stamp.ns;
      if (!odometer.outcome().result.has_pose || ns % 1'000'000'000 != 0) continue;
      const double seconds = 1e-9 * ns;
      error = std::hypot(o.p_WB_m[0], o.p_WB_m[1] - left(seconds), o.p_WB_m[2]);
      std::printf("%4.1f s: %.3f m to the left, true %.3f m, %s\n", seconds, o.p_WB_m[1], left(seconds),
                  kHealthStateNames[static_cast<int>(o.health.state)]);
    }
  }
  return error < 0.05 ? 0 : 1;
}
