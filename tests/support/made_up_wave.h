#pragma once
// A rig that somebody turns by hand in front of far points, with a camera and a gyroscope.
#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "estimator/geometry/so3.h"
#include "platform/samples/samples.h"

namespace epiline::test {

/// Somebody turns a rig; the camera sees far points.
struct MadeUpWave {
  double offset_s = 0.037;  ///< t_IMU = t_image + offset
  Mat3 R_BC = so3_exp(Vec3(0.3, -1.2, 1.9));
  Vec3 bias{0.02, -0.05, 0.03};
  double lasts_s = 10;
  double size = 1, parallax = 0;  ///< rad/s; rad between two images, of points at random depths
  bool one_axis = false, steady = false, has_readings = true;
  std::function<void(ImuSample&)> alter;     ///< of each reading; may be empty
  std::function<void(TrackedFrame&)> spoil;  ///< of each image; may be empty

  static Vec3 rate_at(double t, bool one_axis) {
    Vec3 w(1.2 * std::sin(3.1 * t), 0.9 * std::sin(4.3 * t + 1), 1.1 * std::sin(2.3 * t + 2));
    if (one_axis) w.tail<2>() *= 0.01;
    return w;
  }

  /// `watch`: with add_images(TrackedFrame) and add_reading(ImuSample).
  template <class Watch>
  void play(Watch& wave) const {
    std::mt19937 random(5);
    std::normal_distribution<double> normal;
    std::vector<Vec3> points(80);
    for (Vec3& p : points) p = Vec3(normal(random), normal(random), 2).normalized();
    // attitude of the body by fine steps
    constexpr double kStep = 0.001;
    Mat3 R_WB = Mat3::Identity();
    double next_image = 0.5;
    for (int i = 0; i * kStep < lasts_s; ++i) {
      const double t = i * kStep;
      const Vec3 w = size * (steady ? Vec3(0.1, -0.2, 1.1) : rate_at(t, one_axis));
      if (has_readings && i % 5 == 0) {
        ImuSample s;
        s.stamp = {1'000'000'000 + static_cast<std::int64_t>(t * 1e9)};
        Vec3::Map(s.angular_velocity_rad_s.data()) =
            w + bias + 0.002 * Vec3(normal(random), normal(random), normal(random));
        if (alter) alter(s);
        wave.add_reading(s);
      }
      if (t >= next_image) {  // by the IMU's time
        next_image += 0.05;
        TrackedFrame frame;
        frame.stamp = {1'000'000'000 + static_cast<std::int64_t>((t - offset_s) * 1e9)};
        const Mat3 R_CW = (R_WB * R_BC).transpose();
        for (std::size_t k = 0; k < points.size(); ++k) {
          TrackedFeature f;
          f.id = static_cast<std::uint32_t>(k);
          const Vec3 noise(normal(random), normal(random), normal(random));
          const Vec3 seen = (R_CW * (R_BC * points[k]) + (5e-4 + parallax) * noise).normalized();
          std::copy(seen.data(), seen.data() + 3, f.bearing.begin());
          frame.features.push_back(f);
        }
        if (spoil) spoil(frame);
        wave.add_images(frame);
      }
      R_WB = R_WB * so3_exp(w * kStep);
    }
  }
};

}  // namespace epiline::test
