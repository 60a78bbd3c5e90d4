#include "drivers/program/bench/made_up_flight.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "estimator/geometry/so3.h"

namespace epiline {
namespace {

constexpr int kTexels = 1024;              // a side of the texture, a power of two; it repeats
constexpr float kTexelsPerMetre = 100;     // about a pixel of the camera at 4 m
const Eigen::Vector3f kBox_m(4, 4, 2.5F);  // half of the box' sides

/// EuRoC's size and field of view, looking ahead and a little down.
CameraCalibration made_up_camera() {
  CameraCalibration camera;
  camera.parameters.width = 752;
  camera.parameters.height = 480;
  camera.parameters.intrinsics = {458, 457, 367, 248};
  camera.parameters.distortion = {-0.28, 0.07, 0, 0};
  const Mat3 ahead = (Mat3() << 0, 0, 1, -1, 0, 0, 0, -1, 0).finished();
  camera.R_BC = so3_exp(Vec3(0, 0.3, 0)) * ahead;
  camera.p_BC = Vec3(0.05, 0.02, -0.03);
  return camera;
}

/// Up to 1.5 m/s and 0.6 rad/s, at least 2 m from the walls ahead and at the sides. The biases stay as they are.
FittedMotion made_up_motion(double duration_s) {
  constexpr double kInterval_s = 0.2;
  std::vector<Vec3> positions;
  std::vector<Mat3> rotations;
  for (double t = -kInterval_s; t < duration_s + 3 * kInterval_s; t += kInterval_s) {
    positions.emplace_back(1.2 * std::sin(0.8 * t), 1.1 * std::sin(1.1 * t + 1), 0.6 * std::sin(0.9 * t + 2));
    rotations.push_back(so3_exp(Vec3(0, 0, 0.6 * std::sin(0.7 * t))) *
                        so3_exp(Vec3(0.15 * std::sin(1.3 * t), 0.15 * std::sin(1.1 * t + 2), 0)));
  }
  const Vec3 gyroscope_bias(0.01, -0.02, 0.015), accelerometer_bias(0.05, -0.08, 0.1);  // of a usual cheap IMU
  return {HostStamp{1'000'000'000},
          duration_s,
          {CubicSpline(kInterval_s, std::move(positions)), RotationSpline(kInterval_s, std::move(rotations)), 0},
          {Polyline(1, {gyroscope_bias, gyroscope_bias}), Polyline(1, {accelerometer_bias, accelerometer_bias})}};
}

std::vector<Eigen::Vector2f> rays_of(const CameraParameters& parameters) {
  const Camera camera(parameters);
  std::vector<Eigen::Vector2f> rays;
  rays.reserve(static_cast<std::size_t>(parameters.width) * static_cast<std::size_t>(parameters.height));
  for (int y = 0; y < parameters.height; ++y) {
    for (int x = 0; x < parameters.width; ++x) {
      Vec3 ray = Vec3::UnitZ();
      (void)camera.unproject(Vec2(x, y), ray);  // this lens has a ray for each pixel
      rays.emplace_back(static_cast<float>(ray.x() / ray.z()), static_cast<float>(ray.y() / ray.z()));
    }
  }
  return rays;
}

std::uint8_t& texel(std::vector<std::uint8_t>& texture, int x, int y) {
  return texture[static_cast<std::size_t>((y & (kTexels - 1)) * kTexels + (x & (kTexels - 1)))];
}

/// Rectangles of random size and grey, each over those before: corners at all scales, as in a room. Then blurred, so
/// that a camera that samples it at a few texels' distance sees no false patterns.
std::vector<std::uint8_t> made_up_texture() {
  Random random(1, 0);
  std::vector<std::uint8_t> sharp(kTexels * kTexels), texture(sharp.size());
  const auto draw = [&](int below) { return static_cast<int>(random.uniform(0, below)); };
  for (int i = 0; i < 8000; ++i) {  // covers each texel about ten times
    const int x0 = draw(kTexels), y0 = draw(kTexels), width = 6 + draw(60), height = 6 + draw(60);
    const auto grey = static_cast<std::uint8_t>(20 + draw(216));
    for (int y = y0; y < y0 + height; ++y)
      for (int x = x0; x < x0 + width; ++x) texel(sharp, x, y) = grey;
  }
  for (int y = 0; y < kTexels; ++y) {
    for (int x = 0; x < kTexels; ++x) {
      int sum = 4;  // rounds
      for (int k = 0; k < 9; ++k) sum += texel(sharp, x + k % 3 - 1, y + k / 3 - 1);
      texel(texture, x, y) = static_cast<std::uint8_t>(sum / 9);
    }
  }
  return texture;
}

/// Where the line from `p` in direction `d` leaves the box, in texels. Each wall shows another part of the texture.
Eigen::Vector2f place_on_wall(const Eigen::Vector3f& p, const Eigen::Vector3f& d) {
  int axis = 0;
  float reach = std::numeric_limits<float>::infinity();
  for (int i = 0; i < 3; ++i) {
    const float to_wall = (std::copysign(kBox_m[i], d[i]) - p[i]) / d[i];
    if (to_wall >= reach) continue;
    reach = to_wall;
    axis = i;
  }
  const int u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2;
  const float part = static_cast<float>(kTexels) / 6 * static_cast<float>(2 * axis + (d[axis] > 0 ? 1 : 0));
  return {kTexelsPerMetre * (p[u] + reach * d[u] + kBox_m[u]) + part,
          kTexelsPerMetre * (p[v] + reach * d[v] + kBox_m[v])};
}

/// Linear between four texels, in 1/256 of a texel.
int grey_at(const std::vector<std::uint8_t>& texture, const Eigen::Vector2f& place) {
  const int u = static_cast<int>(256 * place.x()), v = static_cast<int>(256 * place.y()), fu = u & 255, fv = v & 255;
  const int x0 = (u >> 8) & (kTexels - 1), x1 = (x0 + 1) & (kTexels - 1);
  const std::uint8_t* const upper = texture.data() + ((v >> 8) & (kTexels - 1)) * kTexels;
  const std::uint8_t* const lower = texture.data() + (((v >> 8) + 1) & (kTexels - 1)) * kTexels;
  return ((upper[x0] * (256 - fu) + upper[x1] * fu) * (256 - fv) + (lower[x0] * (256 - fu) + lower[x1] * fu) * fv) >>
         16;
}

}  // namespace

MadeUpFlight::MadeUpFlight(double duration_s)
    : camera_(made_up_camera()),
      images_(static_cast<std::size_t>(duration_s * kImage_hz)),
      motion_(made_up_motion(duration_s + 1)),
      rays_(rays_of(camera_.parameters)),
      texture_(made_up_texture()) {}

TimedPose MadeUpFlight::pose_at_image(std::size_t k) const {
  const Motion m = motion_.at(image_s(k));
  return {stamp_of_image(k), m.p_WB, Eigen::Quaterniond(m.R_WB)};
}

void MadeUpFlight::draw_image(std::size_t k, std::uint8_t* pixels) const {
  const Motion m = motion_.at(image_s(k));
  const Eigen::Matrix3f R = (m.R_WB * camera_.R_BC).cast<float>();
  const Eigen::Vector3f p = (m.p_WB + m.R_WB * camera_.p_BC).cast<float>();
  auto noise = static_cast<std::uint32_t>(k);
  for (const Eigen::Vector2f& ray : rays_) {
    const Eigen::Vector3f d = R * ray.homogeneous();
    noise = noise * 1664525 + 1013904223;  // Numerical Recipes' generator
    const int grain = static_cast<int>(noise >> 30) + static_cast<int>((noise >> 28) & 3) - 3;  // sigma 1.6
    *pixels++ = static_cast<std::uint8_t>(std::max(0, grey_at(texture_, place_on_wall(p, d)) + grain));
  }
}

std::vector<ImuSample> MadeUpFlight::imu_samples() const {
  const ImuNoise noise;
  const double white = std::sqrt(kImu_hz);
  Random random(1, 1);
  std::vector<ImuSample> samples;
  for (int i = 0; i <= motion_.duration_s() * kImu_hz; ++i) {
    const double t = static_cast<double>(i) / kImu_hz;
    const Motion m = motion_.at(t);
    const Vec3 w = m.omega_B + motion_.gyroscope_bias(t) + random.normal3(noise.gyroscope_density * white);
    const Vec3 f =
        m.specific_force_B() + motion_.accelerometer_bias(t) + random.normal3(noise.accelerometer_density * white);
    samples.push_back({stamp_at(t), {w.x(), w.y(), w.z()}, {f.x(), f.y(), f.z()}});
  }
  return samples;
}

}  // namespace epiline
