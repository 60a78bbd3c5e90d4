// docs/derivations/cameras.md
#include "estimator/geometry/camera.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <random>
#include <vector>

namespace epiline::test {
namespace {

// Published calibrations.
const CameraParameters kEuroc{CameraModel::kPinholeRadialTangential,
                              752,
                              480,
                              {458.654, 457.296, 367.215, 248.375},
                              {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05}};
const CameraParameters kTumVi{
    CameraModel::kPinholeEquidistant,
    512,
    512,
    {190.97847715128717, 190.9733070521226, 254.93170605935475, 256.8974428996504},
    {0.0034823894022493434, 0.0007150348452162257, -0.0020532361418706202, 0.00020293673591811182}};
// Usenko et al. 2018, table of the BF2M2020S23 lens (195 degrees).
const CameraParameters kDouble{CameraModel::kDoubleSphere, 640, 512, {313.21, 313.21, 319.5, 255.5}, {-0.18, 0.59}};
// Five coefficients, strong barrel: folds back inside the plane.
const CameraParameters kFive{
    CameraModel::kPinholeRadialTangential, 1280, 720, {900, 905, 630, 370}, {-0.35, 0.13, 0.0008, -0.0006, -0.02}};
// An enhanced unified lens (EUCM) and one of Mei, xi 1.45, with the distortion of each.
const CameraParameters kEnhanced{
    CameraModel::kUnified, 752, 480, {460.76, 459.41, 365.89, 249.33}, {0.59, 1.127, 0, 0, 0, 0}};
const double kXi = 1.4456544769803834, kMei[] = {-0.343630, 0.062347, 0.0012608, -0.0002137};
const CameraParameters kUnifiedMei{CameraModel::kUnified,
                                   752,
                                   480,
                                   {895.94 / (1 + kXi), 897.42 / (1 + kXi), 372.22, 238.33},
                                   {kXi / (1 + kXi), 1, kMei[0] / std::pow(1 + kXi, 2), kMei[1] / std::pow(1 + kXi, 4),
                                    kMei[2] / (1 + kXi), kMei[3] / (1 + kXi)}};
const CameraParameters kAll[] = {kEuroc, kTumVi, kDouble, kFive, kEnhanced, kUnifiedMei};

Vec2 random_pixel(const CameraParameters& c, std::mt19937& engine) {
  return {std::uniform_real_distribution<double>(-0.5, c.width - 0.5)(engine),
          std::uniform_real_distribution<double>(-0.5, c.height - 0.5)(engine)};
}

/// A direction the camera sees, of random length.
Vec3 random_point(const Camera& camera, std::mt19937& engine) {
  Vec3 f;
  while (!camera.unproject(random_pixel(camera.parameters(), engine), f)) {
  }
  return f * std::uniform_real_distribution<double>(0.1, 20)(engine);
}

RC_GTEST_PROP(CameraProperty, PixelToBearingAndBack, (std::uint32_t seed)) {
  std::mt19937 engine(seed);
  for (const CameraParameters& c : kAll) {
    const Camera camera(c);
    const Vec2 px = random_pixel(c, engine);
    Vec3 f;
    Vec2 again;
    // The corners of a fisheye's image may see nothing.
    if (!camera.unproject(px, f)) {
      RC_ASSERT(c.model != CameraModel::kPinholeRadialTangential);
      RC_ASSERT((px - Vec2(c.intrinsics[2], c.intrinsics[3])).norm() > 250);
      continue;
    }
    RC_ASSERT(std::abs(f.norm() - 1) < 1e-14);
    RC_ASSERT(camera.project(f, again));
    RC_ASSERT((again - px).norm() < 1e-10);
  }
}

RC_GTEST_PROP(CameraProperty, DirectionToPixelAndBack, (std::uint32_t seed)) {
  std::mt19937 engine(seed);
  for (const CameraParameters& c : kAll) {
    const Camera camera(c);
    const Vec3 p = random_point(camera, engine);
    Vec2 px;
    Vec3 f;
    RC_ASSERT(camera.project(p, px));
    RC_ASSERT(camera.unproject(px, f));
    RC_ASSERT((f - p.normalized()).norm() < 1e-10);
  }
}

RC_GTEST_PROP(CameraProperty, JacobianEqualsNumericalDerivative, (std::uint32_t seed)) {
  std::mt19937 engine(seed);
  for (const CameraParameters& c : kAll) {
    const Camera camera(c);
    const Vec3 p = random_point(camera, engine);
    Vec2 px;
    Mat23 J, numeric;
    RC_ASSERT(camera.project(p, px, &J));
    const double h = 1e-4 * p.norm();
    for (int axis = 0; axis < 3; ++axis) {
      const auto at = [&](double x) {
        Vec2 u = Vec2::Zero();
        RC_ASSERT(camera.project(p + x * Vec3::Unit(axis), u));
        return u;
      };
      numeric.col(axis) = (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h);
    }
    RC_ASSERT((J - numeric).norm() < 1e-7 * J.norm());
  }
}

RC_GTEST_PROP(CameraProperty, ChartAtTheBearing, (std::uint32_t seed)) {
  std::mt19937 engine(seed);
  for (const CameraParameters& c : kAll) {
    const Camera camera(c);
    Vec3 f, expected;
    Vec2 px = random_pixel(c, engine), again;
    Mat23 J, expected_J;
    RC_ASSERT(camera.bearing(px, f, J) == camera.unproject(px, expected));
    if (!camera.unproject(px, expected)) continue;
    RC_ASSERT((f - expected).norm() < 1e-14);
    RC_ASSERT(camera.project(f, again, &expected_J));
    RC_ASSERT((J - expected_J).norm() < 1e-10 * J.norm());
    RC_ASSERT((J * f).norm() < 1e-13 * J.norm());
  }
}

TEST(Camera, AxisAndItsNeighbourhoodAreRegular) {
  for (const CameraParameters& c : kAll) {
    const Camera camera(c);
    Mat23 on_axis, J;
    Vec2 px;
    ASSERT_TRUE(camera.project(Vec3(0, 0, 2), px, &on_axis));
    EXPECT_LT((px - Vec2(c.intrinsics[2], c.intrinsics[3])).norm(), 1e-12);
    // Pixels per radian, at a distance of 2.
    EXPECT_NEAR(
        on_axis(0, 0) * c.intrinsics[1] + on_axis(1, 1) * c.intrinsics[0],
        2 * c.intrinsics[0] * c.intrinsics[1] * 0.5 * camera.focal_px() / (0.5 * (c.intrinsics[0] + c.intrinsics[1])),
        1e-9);
    for (const double off : {1e-300, 1e-160, 1e-15, 1e-9, 1e-6}) {
      ASSERT_TRUE(camera.project(Vec3(off, -off, 2), px, &J));
      EXPECT_LT((J - on_axis).norm(), 1e-3) << off;
      Vec3 f;
      ASSERT_TRUE(camera.unproject(px, f));
      EXPECT_NEAR(f.x(), off / 2, 1e-14);
    }
  }
}

// OpenCV's own implementation of both distortions.
TEST(Camera, AgreesWithOpenCv) {
  std::mt19937 engine(5);
  for (const CameraParameters& c : {kEuroc, kFive, kTumVi}) {
    const Camera camera(c);
    const cv::Matx33d K(c.intrinsics[0], 0, c.intrinsics[2], 0, c.intrinsics[1], c.intrinsics[3], 0, 0, 1);
    const bool fisheye = c.model == CameraModel::kPinholeEquidistant;
    const std::vector<double> k(c.distortion.begin(), c.distortion.begin() + (fisheye ? 4 : 5));
    std::vector<cv::Point3d> points;
    std::vector<cv::Point2d> pixels;
    while (points.size() < 500) {
      const Vec3 p = random_point(camera, engine);
      if (p.z() > 0.05 * p.norm()) points.emplace_back(p.x(), p.y(), p.z());
    }
    if (fisheye)
      cv::fisheye::projectPoints(points, pixels, cv::Vec3d(), cv::Vec3d(), K, k);
    else
      cv::projectPoints(points, cv::Vec3d(), cv::Vec3d(), K, k, pixels);
    for (std::size_t i = 0; i < points.size(); ++i) {
      Vec2 px;
      ASSERT_TRUE(camera.project(Vec3(points[i].x, points[i].y, points[i].z), px));
      EXPECT_LT((px - Vec2(pixels[i].x, pixels[i].y)).norm(), 1e-9);
    }
  }
}

// The paper's statement of the double sphere: into the first unit sphere, shift by xi, into the second, shift by
// alpha / (1 - alpha), pinhole.
TEST(Camera, DoubleSphereIsTwoSpheresAndAPinhole) {
  std::mt19937 engine(6);
  const Camera camera(kDouble);
  const double xi = kDouble.distortion[0], alpha = kDouble.distortion[1];
  for (int n = 0; n < 500; ++n) {
    const Vec3 p = random_point(camera, engine);
    const Vec3 q = (p.normalized() + xi * Vec3::UnitZ()).normalized() + alpha / (1 - alpha) * Vec3::UnitZ();
    const Vec3 f_intrinsics = q / q.z() / (1 - alpha);  // Usenko's fx, fy are those of the pinhole divided by 1 - alpha
    Vec2 px;
    ASSERT_TRUE(camera.project(p, px));
    EXPECT_NEAR(px.x(), kDouble.intrinsics[0] * f_intrinsics.x() + kDouble.intrinsics[2], 1e-9);
    EXPECT_NEAR(px.y(), kDouble.intrinsics[1] * f_intrinsics.y() + kDouble.intrinsics[3], 1e-9);
  }
}

// Mei and Rives 2007: onto the unit sphere, seen from xi behind its centre, distorted, gamma.
TEST(Camera, UnifiedIsMeisLens) {
  std::mt19937 engine(7);
  const Camera camera(kUnifiedMei);
  for (int n = 0; n < 500; ++n) {
    const Vec3 p = random_point(camera, engine);
    const Vec3 q = p.normalized() + kXi * Vec3::UnitZ();
    const double x = q.x() / q.z(), y = q.y() / q.z(), s = x * x + y * y, radial = 1 + s * (kMei[0] + s * kMei[1]);
    Vec2 px;
    ASSERT_TRUE(camera.project(p, px));
    EXPECT_NEAR(px.x(), 895.94 * (x * radial + 2 * kMei[2] * x * y + kMei[3] * (s + 2 * x * x)) + 372.22, 1e-9);
    EXPECT_NEAR(px.y(), 897.42 * (y * radial + kMei[2] * (s + 2 * y * y) + 2 * kMei[3] * x * y) + 238.33, 1e-9);
  }
}

// Khomutenko et al. 2016: the plane at z = 1 of an ellipsoid.
TEST(Camera, UnifiedIsTheEnhancedUnifiedLens) {
  std::mt19937 engine(8);
  const Camera camera(kEnhanced);
  for (int n = 0; n < 500; ++n) {
    const Vec3 p = random_point(camera, engine);
    const double rho = std::sqrt(1.127 * (p.x() * p.x() + p.y() * p.y()) + p.z() * p.z());
    Vec2 px;
    ASSERT_TRUE(camera.project(p, px));
    EXPECT_NEAR(px.x(), 460.76 * p.x() / (0.59 * rho + 0.41 * p.z()) + 365.89, 1e-9);
    EXPECT_NEAR(px.y(), 459.41 * p.y() / (0.59 * rho + 0.41 * p.z()) + 249.33, 1e-9);
  }
}

Vec3 off_axis(double degrees) { return {std::sin(degrees * M_PI / 180), 0, std::cos(degrees * M_PI / 180)}; }

TEST(Camera, FisheyesSeeBehindTheirImagePlane) {
  for (const CameraParameters& c : {kTumVi, kDouble}) {
    const Camera camera(c);
    Vec2 px;
    Vec3 f;
    for (const double degrees : {89.0, 90.0, 91.0, 97.5}) {
      ASSERT_TRUE(camera.project(3 * off_axis(degrees), px));
      ASSERT_TRUE(camera.unproject(px, f));
      EXPECT_LT((f - off_axis(degrees)).norm(), 1e-12) << degrees;
    }
    EXPECT_FALSE(camera.project(Vec3(0, 0, -1), px));
  }
}

TEST(Camera, RefusesWhatTheModelDoesNotDefine) {
  Vec2 px;
  Vec3 f;
  const Camera five(kFive), euroc(kEuroc);
  EXPECT_FALSE(euroc.project(Vec3(0, 0, -1), px));
  EXPECT_FALSE(euroc.project(Vec3(1, 0, 0), px));
  EXPECT_FALSE(euroc.project(Vec3::Constant(std::numeric_limits<double>::quiet_NaN()), px));
  EXPECT_FALSE(euroc.unproject(Vec2::Constant(std::numeric_limits<double>::quiet_NaN()), f));
  EXPECT_FALSE(euroc.unproject(Vec2::Constant(std::numeric_limits<double>::infinity()), f));
  EXPECT_FALSE(Camera().unproject(Vec2(1, 1), f));
  EXPECT_FALSE(Camera(kTumVi).project(Vec3::Zero(), px));
  // Brute force: where the distorted radius of kFive has its first maximum, without tangential terms.
  CameraParameters radial = kFive;
  radial.distortion[2] = radial.distortion[3] = 0;
  double fold = 0, highest = 0;
  for (double r = 0; r < 20; r += 1e-4) {
    const double s = r * r, d = r * (1 + s * (-0.35 + s * (0.13 + s * -0.02)));
    if (d < highest) break;
    highest = d;
    fold = r;
  }
  const Camera camera(radial);
  EXPECT_TRUE(camera.project(Vec3(fold - 1e-3, 0, 1), px));
  EXPECT_FALSE(camera.project(Vec3(fold + 1e-3, 0, 1), px));
  EXPECT_FALSE(camera.project(Vec3(10, 0, 1), px));
  EXPECT_TRUE(camera.unproject(Vec2(630 + 900 * (highest - 1e-3), 370), f));
  EXPECT_NEAR(f.x() / f.z(), fold, 0.1);
  EXPECT_FALSE(camera.unproject(Vec2(630 + 900 * (highest + 1e-3), 370), f));
}

TEST(Camera, PinholesEndAt87Degrees) {
  Vec2 px;
  EXPECT_TRUE(Camera(kEuroc).project(off_axis(86), px));
  EXPECT_FALSE(Camera(kEuroc).project(off_axis(88), px));
}

// theta (1 - 0.1 theta^2) rises up to theta = 1 / sqrt(0.3), where it is two thirds of theta.
TEST(Camera, EquidistantEndsWhereItFolds) {
  CameraParameters c = kTumVi;
  c.distortion = {-0.1, 0, 0, 0};
  const Camera camera(c);
  const double fold = 1 / std::sqrt(0.3), radius = 2 * fold / 3;
  Vec2 px;
  Vec3 f;
  EXPECT_TRUE(camera.project(off_axis(fold * 180 / M_PI - 0.1), px));
  EXPECT_FALSE(camera.project(off_axis(fold * 180 / M_PI + 0.1), px));
  const auto at = [&](double r) { return Vec2(c.intrinsics[2] + r * c.intrinsics[0], c.intrinsics[3]); };
  EXPECT_TRUE(camera.unproject(at(radius - 1e-4), f));
  EXPECT_NEAR(std::atan2(f.x(), f.z()), fold, 0.05);
  EXPECT_FALSE(camera.unproject(at(radius + 1e-4), f));
}

TEST(Camera, EveryFaultOfTheParametersHasItsName) {
  for (const CameraParameters& c : kAll) EXPECT_EQ(fault_of(c), CameraFault::kNone);
  const auto with = [](auto change) {
    CameraParameters c = kDouble;
    change(c);
    return fault_of(c);
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(with([](auto& c) { c.width = 0; }), CameraFault::kSize);
  EXPECT_EQ(with([](auto& c) { c.height = -1; }), CameraFault::kSize);
  EXPECT_EQ(with([&](auto& c) { c.intrinsics[2] = nan; }), CameraFault::kNotFinite);
  EXPECT_EQ(with([&](auto& c) { c.distortion[4] = nan; }), CameraFault::kNotFinite);
  EXPECT_EQ(with([](auto& c) { c.intrinsics[0] = 0; }), CameraFault::kFocal);
  EXPECT_EQ(with([](auto& c) { c.intrinsics[1] = -300; }), CameraFault::kFocal);
  EXPECT_EQ(with([](auto& c) { c.intrinsics[2] = 640; }), CameraFault::kCentre);
  EXPECT_EQ(with([](auto& c) { c.intrinsics[3] = -1; }), CameraFault::kCentre);
  EXPECT_EQ(with([](auto& c) { c.distortion[1] = 1.5; }), CameraFault::kDistortion);
  EXPECT_EQ(with([](auto& c) { c.distortion[0] = -1; }), CameraFault::kDistortion);
  CameraParameters unified = kEnhanced;
  unified.distortion[1] = 0;
  EXPECT_EQ(fault_of(unified), CameraFault::kDistortion);
}

}  // namespace
}  // namespace epiline::test
