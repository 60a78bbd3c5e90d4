#include "drivers/laboratory/render/renderer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <vector>

#include "drivers/flights/motion/random.h"
#include "drivers/laboratory/render/effects.h"
#include "estimator/geometry/so3.h"

namespace epiline {
namespace {

constexpr int kWidth = 752, kHeight = 480;

/// Constant velocity and constant rate about a fixed axis of the body.
class UniformMotion final : public MotionModel {
 public:
  Vec3 p{0, 0, 0}, v{0, 0, 0}, omega_B{0, 0, 0};
  Mat3 R = Mat3::Identity();
  Motion at(double t_s) const override {
    const double t = t_s - 0.5;  // the state above is that of the middle
    return {p + t * v, v, Vec3::Zero(), R * so3_exp(t * omega_B), omega_B};
  }
  double duration_s() const override { return 1; }
};

CameraParameters camera(CameraModel model) {
  CameraParameters c{
      .model = model, .width = kWidth, .height = kHeight, .intrinsics = {458, 457, 367, 248}, .distortion = {}};
  if (model == CameraModel::kPinholeRadialTangential) c.distortion = {-0.28, 0.074, 0.0002, 1.8e-5, 0};
  if (model == CameraModel::kPinholeEquidistant) {
    c.intrinsics = {230, 231, 370, 243};
    c.distortion = {0.0035, 0.0007, -0.002, 0.0002, 0};
  }
  if (model == CameraModel::kDoubleSphere) {
    c.intrinsics = {200, 201, 370, 243};
    c.distortion = {-0.18, 0.59, 0, 0, 0};
  }
  return c;
}

CameraEffects no_effects() { return parse_effects("none")->camera; }

const TextureAtlas& atlas() {
  static const TextureAtlas a(1);
  return a;
}

/// The image in the middle of the motion. The camera's axes are the body's.
cv::Mat picture(const World& world, const MotionModel& motion, const CameraParameters& lens,
                const CameraEffects& effects, std::uint64_t seed = 1) {
  const RenderSettings settings{.camera = lens, .effects = effects, .seed = seed};
  const Renderer renderer(world, atlas(), motion, settings, {0.5});
  cv::Mat image(lens.height, lens.width, CV_8U);
  renderer.render(0, image.data);
  return image;
}

/// A rectangle in the plane z = depth that faces the camera at the origin, of even brightness but for faint paint.
Panel card(const Vec3& centre, double half_u, double half_v, double shade) {
  return {centre, Vec3::UnitX(), -Vec3::UnitY(), half_u, half_v, Material::kPaint, 1, {300, 300}, shade};
}

constexpr int kColumns = 9, kRows = 6;  // inner corners
constexpr double kSquare_m = 0.1;

/// A checkerboard in the plane z = 0, seen from negative z; its first inner corner is the origin.
World checkerboard() {
  World world;
  world.sky = 60;
  const Vec3 middle(0.5 * (kColumns - 1) * kSquare_m, 0.5 * (kRows - 1) * kSquare_m, 0.001);
  world.panels.push_back(card(middle, kSquare_m * (0.5 * kColumns + 1), kSquare_m * (0.5 * kRows + 1), 1));
  for (int i = -1; i < kColumns; ++i)
    for (int j = -1; j < kRows; ++j)
      if ((i + j) % 2 == 0)
        world.panels.push_back(
            card({(i + 0.5) * kSquare_m, (j + 0.5) * kSquare_m, 0}, kSquare_m / 2, kSquare_m / 2, 0.1));
  return world;
}

std::vector<cv::Point2f> find_corners(const cv::Mat& image) {
  std::vector<cv::Point2f> corners;
  if (!cv::findChessboardCorners(image, {kColumns, kRows}, corners)) return {};
  cv::cornerSubPix(image, corners, {4, 4}, {-1, -1}, {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 50, 1e-3});
  return corners;
}

/// Looks at the board's middle from different sides.
UniformMotion view_of_board(int i) {
  Random random(5, static_cast<std::uint64_t>(i));
  UniformMotion m;
  const Vec3 middle(0.4 + random.uniform(-0.12, 0.12), 0.25 + random.uniform(-0.12, 0.12), 0);
  m.R = so3_exp(Vec3(random.uniform(-0.5, 0.5), random.uniform(-0.5, 0.5), random.uniform(-0.4, 0.4)));
  m.p = middle - m.R.col(2) * random.uniform(0.8, 1.3);
  return m;
}

std::string model_name(const testing::TestParamInfo<CameraModel>& info) {
  return std::vector<std::string>{"RadialTangential", "Equidistant",
                                  "DoubleSphere"}[static_cast<std::size_t>(info.param)];
}

class RendererOfEveryLens : public testing::TestWithParam<CameraModel> {};
INSTANTIATE_TEST_SUITE_P(Lenses, RendererOfEveryLens,
                         testing::Values(CameraModel::kPinholeRadialTangential, CameraModel::kPinholeEquidistant,
                                         CameraModel::kDoubleSphere),
                         model_name);

// OpenCV finds the corners of a rendered checkerboard where the camera model projects them.
TEST_P(RendererOfEveryLens, DrawsCornersWhereTheyProject) {
  const World board = checkerboard();
  const Camera model(camera(GetParam()));
  int seen = 0;
  double sum2 = 0;
  for (int i = 0; i < 6; ++i) {
    const UniformMotion m = view_of_board(i);
    const auto corners = find_corners(picture(board, m, camera(GetParam()), no_effects()));
    if (corners.empty()) continue;
    // The finder may begin at the far corner: then the list runs backwards.
    Vec2 first, last;
    const auto place = [&](int k) { return Vec3(kSquare_m * (k % kColumns), kSquare_m * (k / kColumns), 0); };
    const auto project = [&](int k, Vec2& px) { return model.project(m.R.transpose() * (place(k) - m.p), px); };
    constexpr int kCorners = kColumns * kRows;
    ASSERT_TRUE(project(0, first) && project(kCorners - 1, last));
    const Vec2 found(corners[0].x, corners[0].y);
    const bool backwards = (found - first).norm() > (found - last).norm();
    for (int k = 0; k < kCorners; ++k) {
      Vec2 px;
      ASSERT_TRUE(project(backwards ? kCorners - 1 - k : k, px));
      sum2 += (px - Vec2(corners[k].x, corners[k].y)).squaredNorm();
      EXPECT_NEAR(px.x(), corners[k].x, 0.3);
      EXPECT_NEAR(px.y(), corners[k].y, 0.3);
      ++seen;
    }
  }
  ASSERT_GE(seen, 4 * kColumns * kRows);
  EXPECT_LT(std::sqrt(sum2 / seen), 0.1);
}

// The vector kernel shows at each pixel the panel that a plain ray, without any culling, meets there.
TEST_P(RendererOfEveryLens, ShowsThePanelThatARayMeets) {
  World world;
  world.sky = 250;
  Random random(3, 0);
  for (int i = 0; i < 150; ++i) {
    const Mat3 R = so3_exp(random.normal3(1.5));
    world.panels.push_back({random.normal3(4),
                            R.col(0),
                            R.col(1),
                            random.uniform(0.05, 2),
                            random.uniform(0.05, 2),
                            Material::kPaint,
                            1,
                            {300, 300},
                            random.uniform(0.1, 1.5)});
  }
  UniformMotion m;
  m.R = so3_exp(Vec3(0.3, -0.4, 0.2));
  const cv::Mat image = picture(world, m, camera(GetParam()), no_effects());
  const Camera model(camera(GetParam()));
  const RenderSettings settings{.camera = camera(GetParam()), .effects = no_effects()};
  const double gain = Renderer(world, atlas(), m, settings, {0.5}).exposure(0).gain;
  int compared = 0, wrong = 0;
  for (int y = 2; y < kHeight - 2; y += 3) {
    for (int x = 2; x < kWidth - 2; x += 3) {
      // Only pixels whose whole neighbourhood shows one panel.
      std::optional<RayHit> hits[5];
      const Vec2 offsets[5] = {{0, 0}, {-1, -1}, {1, -1}, {-1, 1}, {1, 1}};
      bool same = true;
      for (int k = 0; k < 5; ++k) {
        Vec3 f;
        if (!model.unproject(Vec2(x, y) + offsets[k], f)) {
          same = false;
          break;
        }
        hits[k] = cast_ray(world, m.p, m.R * f);
        same = same && hits[k].has_value() == hits[0].has_value() && (!hits[k] || hits[k]->panel == hits[0]->panel);
      }
      if (!same) continue;
      const double mean = atlas().mean(Material::kPaint);
      const double radiance = hits[0] ? world.panels[hits[0]->panel].shade * mean : world.sky;
      const double expected = std::min(255.0, gain * radiance);
      ++compared;
      if (std::abs(image.at<std::uint8_t>(y, x) - expected) > 2 + 0.3 * expected) ++wrong;
    }
  }
  EXPECT_GT(compared, 20000);
  EXPECT_LT(wrong, compared / 1000) << compared;
}

// OpenCV's optical flow on two rendered images is the flow of the motion between them.
TEST(Renderer, ImagesFlowAsTheCameraMoves) {
  World world;
  const Vec3 x = Vec3::UnitX(), y = Vec3::UnitY();
  world.panels.push_back({{0, 0, 3}, x, -y, 20, 20, Material::kGravel, 150, {0, 0}, 1});
  UniformMotion before, after;
  after.p = Vec3(0.05, -0.03, 0.1);
  after.R = so3_exp(Vec3(0.01, 0.015, -0.02));
  const CameraParameters lens = camera(CameraModel::kPinholeRadialTangential);
  const Camera model(lens);
  const cv::Mat first = picture(world, before, lens, no_effects()), second = picture(world, after, lens, no_effects());
  std::vector<cv::Point2f> from, to;
  cv::goodFeaturesToTrack(first, from, 200, 0.01, 12);
  std::vector<unsigned char> found;
  std::vector<float> error;
  cv::calcOpticalFlowPyrLK(first, second, from, to, found, error, {21, 21}, 3);
  std::vector<double> distance;
  for (std::size_t i = 0; i < from.size(); ++i) {
    Vec3 f;
    Vec2 px;
    if (!found[i] || !model.unproject(Vec2(from[i].x, from[i].y), f)) continue;
    const Vec3 point = f * (3 / f.z());
    if (!model.project(after.R.transpose() * (point - after.p), px)) continue;
    distance.push_back((px - Vec2(to[i].x, to[i].y)).norm());
  }
  ASSERT_GT(distance.size(), 150U);
  std::sort(distance.begin(), distance.end());
  EXPECT_LT(distance[distance.size() / 2], 0.09);
  EXPECT_LT(distance[distance.size() * 9 / 10], 0.2);
}

/// How wide the edge of a bright half plane is in the middle row, from 10 % to 90 %, and where it is at 50 %.
struct Edge {
  double at, width;
};
Edge edge_of(const cv::Mat& image, int row) {
  const auto crossing = [&](double share) {
    const double low = image.at<std::uint8_t>(row, 5), high = image.at<std::uint8_t>(row, kWidth - 6);
    const double level = low + share * (high - low);
    for (int x = 1; x < kWidth; ++x) {
      const double a = image.at<std::uint8_t>(row, x - 1), b = image.at<std::uint8_t>(row, x);
      if (a < level && b >= level) return x - 1 + (level - a) / (b - a);
    }
    return -1.0;
  };
  return {crossing(0.5), crossing(0.9) - crossing(0.1)};
}

CameraParameters pinhole() {
  return {.width = kWidth, .height = kHeight, .intrinsics = {450, 450, 375.5, 239.5}, .distortion = {}};
}

World half_plane() {
  World world;
  world.sky = 30;
  world.panels.push_back(card({50, 0, 5}, 50, 100, 1));
  return world;
}

// What moves is smeared over the way it moves while the shutter is open, evenly about the middle of the exposure.
TEST(Renderer, BlursOverTheExposure) {
  UniformMotion m;
  CameraEffects effects = no_effects();
  const Edge sharp = edge_of(picture(half_plane(), m, pinhole(), effects), kHeight / 2);
  effects.exposure_s = 0.01;
  m.omega_B = Vec3(0, 4, 0);  // 18 px while the shutter is open
  const Edge turned = edge_of(picture(half_plane(), m, pinhole(), effects), kHeight / 2);
  m.omega_B.setZero();
  m.v = Vec3(2, 0, 0);  // 1.8 px
  effects.exposure_s = 0.05;
  const Edge moved = edge_of(picture(half_plane(), m, pinhole(), effects), kHeight / 2);
  EXPECT_LT(sharp.width, 1.2);
  EXPECT_NEAR(turned.width, 0.8 * 4 * 0.01 * 450, 1.5);
  EXPECT_NEAR(moved.width, 0.8 * 2 * 0.05 * 450 / 5, 1.5);
  EXPECT_NEAR(turned.at, sharp.at, 0.5);
  EXPECT_NEAR(moved.at, sharp.at, 0.5);
}

// A rolling shutter shears a turning image about its middle row.
TEST(Renderer, RollsTheShutter) {
  UniformMotion m;
  m.omega_B = Vec3(0, 1, 0);
  CameraEffects effects = no_effects();
  effects.row_time_s = 50e-6;
  const cv::Mat image = picture(half_plane(), m, pinhole(), effects);
  const double shear = edge_of(image, kHeight - 20).at - edge_of(image, 20).at;
  EXPECT_NEAR(shear, -1 * 50e-6 * (kHeight - 40) * 450, 0.3);
  EXPECT_NEAR(edge_of(image, kHeight / 2).at, 375.5, 0.5);
}

World even_wall(double shade) {
  World world;
  world.panels.push_back(card({0, 0, 5}, 100, 100, shade));
  return world;
}

TEST(Renderer, DarkensTheCorners) {
  CameraEffects effects = no_effects();
  const cv::Mat even = picture(even_wall(1), UniformMotion{}, pinhole(), effects);
  effects.vignette = 0.4;
  const cv::Mat image = picture(even_wall(1), UniformMotion{}, pinhole(), effects);
  EXPECT_NEAR(image.at<std::uint8_t>(0, 0), 0.6 * even.at<std::uint8_t>(0, 0), 1.5);
  EXPECT_NEAR(image.at<std::uint8_t>(240, 376), even.at<std::uint8_t>(240, 376), 1.5);
}

// Noise has the variance of reading and of counting photons, and nothing to do with its neighbours.
TEST(Renderer, AddsNoiseOfTheRightSize) {
  CameraEffects effects = no_effects();
  const cv::Mat clean = picture(even_wall(1), UniformMotion{}, pinhole(), effects);
  effects.read_sigma = 2;
  effects.shot_factor = 0.1;
  const cv::Mat noisy = picture(even_wall(1), UniformMotion{}, pinhole(), effects);
  double sum = 0, sum2 = 0, beside = 0, level = 0;
  int n = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 1; x < kWidth; ++x) {
      const double d = noisy.at<std::uint8_t>(y, x) - clean.at<std::uint8_t>(y, x);
      const double left = noisy.at<std::uint8_t>(y, x - 1) - clean.at<std::uint8_t>(y, x - 1);
      sum += d;
      sum2 += d * d;
      beside += d * left;
      level += clean.at<std::uint8_t>(y, x);
      ++n;
    }
  }
  const double variance = sum2 / n - (sum / n) * (sum / n);
  const double rounding = 2.0 / 12;  // of both images
  EXPECT_NEAR(variance, 4 + 0.1 * level / n + rounding, 0.25);
  EXPECT_NEAR(sum / n, 0, 0.15);  // an even wall is rounded the same way everywhere
  EXPECT_NEAR(beside / n / variance, 0, 0.02);
  const cv::Mat again = picture(even_wall(1), UniformMotion{}, pinhole(), effects);
  EXPECT_EQ(cv::norm(noisy, again, cv::NORM_INF), 0);
  const cv::Mat other = picture(even_wall(1), UniformMotion{}, pinhole(), effects, 2);
  EXPECT_GT(cv::norm(noisy, other, cv::NORM_INF), 0);
}

// Brightness is brought back to the same level when the view becomes darker, not at once; without it, it is not.
TEST(Renderer, ExposureFollowsTheScene) {
  World world;
  world.panels.push_back(card({0, 0, 5}, 100, 100, 1));  // ahead
  world.panels.push_back(
      {{0, 0, -5}, Vec3::UnitX(), Vec3::UnitY(), 100, 100, Material::kPaint, 1, Vec2::Zero(), 0.25});  // behind
  UniformMotion m;
  m.omega_B = Vec3(0, 3.1415926, 0);
  m.R = so3_exp(Vec3(0, 1.5707963, 0));  // from ahead to behind in a second
  std::vector<double> times;
  for (int i = 0; i <= 20; ++i) times.push_back(0.05 * i);
  RenderSettings settings{.camera = pinhole(), .effects = no_effects()};
  settings.effects.auto_exposure = true;
  settings.effects.exposure_s = 0.004;
  const Renderer automatic(world, atlas(), m, settings, times);
  EXPECT_GT(automatic.exposure(20).gain, 2.2 * automatic.exposure(0).gain);
  EXPECT_LT(automatic.exposure(20).gain, 4.1 * automatic.exposure(0).gain);
  EXPECT_GT(automatic.exposure(20).time_s, automatic.exposure(0).time_s);
  for (int i = 1; i <= 20; ++i) EXPECT_LT(automatic.exposure(i).gain, 1.35 * automatic.exposure(i - 1).gain);
  settings.effects.auto_exposure = false;
  const Renderer fixed(world, atlas(), m, settings, times);
  EXPECT_EQ(fixed.exposure(20).gain, fixed.exposure(0).gain);
}

}  // namespace
}  // namespace epiline
