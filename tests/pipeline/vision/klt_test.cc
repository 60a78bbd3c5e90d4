#include "pipeline/vision/klt.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <Eigen/Dense>
#include <limits>
#include <opencv2/video/tracking.hpp>

#include "tests/pipeline/vision/klt_tracks.h"

namespace epiline {
namespace {

constexpr int kSide = 16;

// ------------------------------------------------------------------------------------------------ reference in double

using Patch = Eigen::Array<double, kSide, kSide>;

double interpolate(const TestImage& image, double x, double y) {
  const int ix = static_cast<int>(std::floor(x)), iy = static_cast<int>(std::floor(y));
  const double fx = x - ix, fy = y - iy;
  return (1 - fy) * ((1 - fx) * image.at(ix, iy) + fx * image.at(ix + 1, iy)) +
         fy * ((1 - fx) * image.at(ix, iy + 1) + fx * image.at(ix + 1, iy + 1));
}

Patch patch_at(const TestImage& image, Eigen::Vector2d centre) {
  Patch p;
  for (int r = 0; r < kSide; ++r) {
    for (int c = 0; c < kSide; ++c) p(r, c) = interpolate(image, centre.x() - 7.5 + c, centre.y() - 7.5 + r);
  }
  return p;
}

Eigen::Vector2d to_grid(Eigen::Vector2d p) { return ((p.array() - 7.5) * 128 + 0.5).floor() / 128 + 7.5; }

struct OneStep {
  Eigen::Vector2d found;
  double eigenvalue;  // of the corrected matrix, a pixel
  double slope;       // the larger gain slope, before the kernel's limit
};

// Least squares over shift, gain and bias, all four at once: nothing is eliminated by hand. The model is
// image(x + d) = a + b T(x); the new image's gradient is taken from the template.
OneStep reference_step(const TestImage& before, const TestImage& now, Eigen::Vector2d old, Eigen::Vector2d start) {
  const Eigen::Vector2d at = to_grid(old), offset = at - old, from = to_grid(start + offset);
  const Patch t = patch_at(before, at), i = patch_at(now, from);
  const Patch gx = (patch_at(before, at + Eigen::Vector2d(1, 0)) - patch_at(before, at - Eigen::Vector2d(1, 0))) / 2;
  const Patch gy = (patch_at(before, at + Eigen::Vector2d(0, 1)) - patch_at(before, at - Eigen::Vector2d(0, 1))) / 2;
  Eigen::Matrix<double, kSide * kSide, 4> A;
  A << gx.reshaped().matrix(), gy.reshaped().matrix(), Eigen::VectorXd::Ones(kSide * kSide), t.reshaped().matrix();
  const Eigen::Matrix4d covariances = (A.transpose() * A).inverse();
  const Eigen::Vector4d solution = covariances * (A.transpose() * (i - t).reshaped().matrix());
  const Eigen::Matrix2d schur = covariances.topLeftCorner<2, 2>().inverse();
  const double half_trace = schur.trace() / 2;
  const auto covariance = [](const Patch& a, const Patch& b) { return ((a - a.mean()) * (b - b.mean())).sum(); };
  return {from - solution.head<2>() - offset,
          (half_trace - std::sqrt(half_trace * half_trace - schur.determinant())) / (kSide * kSide),
          std::max(std::abs(covariance(gx, t)), std::abs(covariance(gy, t))) / covariance(t, t)};
}

double reference_correlation(const TestImage& before, const TestImage& now, Eigen::Vector2d old,
                             Eigen::Vector2d found) {
  const Eigen::Vector2d at = to_grid(old);
  const Patch t = patch_at(before, at), i = patch_at(now, to_grid(found + at - old));
  const Patch tc = t - t.mean(), ic = i - i.mean();
  return (tc * ic).sum() / std::sqrt((tc * tc).sum() * (ic * ic).sum());
}

// ------------------------------------------------------------------------------------------------------------- helpers

TrackerConfig one_step_config() {
  TrackerConfig config;
  config.levels = 1;
  config.iterations = 1;
  config.backward_iterations = 1;
  config.min_correlation = -2;
  config.max_backward_px = 1e9f;
  config.max_step_px = 1e9f;
  config.min_eigenvalue = 0;
  return config;
}

/// Root mean square distance per coordinate from where the features went; fails if more than 2 % were not found.
double rms_error(const std::vector<KltTrack>& tracks, double dx, double dy) {
  double sum = 0;
  int found = 0;
  for (const KltTrack& t : tracks) {
    if (t.end != KltEnd::kFound) continue;
    ++found;
    sum += std::pow(t.found_x - t.x - dx, 2) + std::pow(t.found_y - t.y - dy, 2);
  }
  EXPECT_GE(found, 0.98 * static_cast<double>(tracks.size()));
  return std::sqrt(sum / (2 * std::max(found, 1)));
}

// Compares one step and the correlation with the reference; returns how many places could be compared.
int compare_with_reference(const TestImage& before, const TestImage& now, std::vector<KltTrack> tracks) {
  const std::vector<KltTrack> start = tracks;
  track(one_step_config(), before, now, tracks);
  int compared = 0;
  for (std::size_t k = 0; k < tracks.size(); ++k) {
    const Eigen::Vector2d old(start[k].x, start[k].y), from(start[k].found_x, start[k].found_y);
    const OneStep expected = reference_step(before, now, old, from);
    const bool far = !((expected.found - old).norm() < 5) || !(expected.eigenvalue > 20) || expected.slope > 0.43;
    if (far) continue;  // outside the image, or near the limits that the kernel treats differently by design
    EXPECT_EQ(tracks[k].end, KltEnd::kFound) << "at " << old.transpose();
    EXPECT_NEAR(tracks[k].found_x, expected.found.x(), 0.012) << "at " << old.transpose();
    EXPECT_NEAR(tracks[k].found_y, expected.found.y(), 0.012) << "at " << old.transpose();
    const Eigen::Vector2d found(tracks[k].found_x, tracks[k].found_y);
    const double correlation = reference_correlation(before, now, old, found);
    EXPECT_TRUE(!std::isfinite(correlation) || std::abs(tracks[k].correlation - correlation) < 3e-3)
        << tracks[k].correlation << " for " << correlation << " at " << old.transpose();
    ++compared;
  }
  return compared;
}

// --------------------------------------------------------------------------------------------------------------- tests

TEST(Klt, OneStepSolvesTheLeastSquaresOnTexture) {
  const Waves waves(5);
  const TestImage before = shifted(waves, 160, 160, 0, 0), now = shifted(waves, 160, 160, 0.6, -0.4, 0.8, 20);
  on_every_target([&] { EXPECT_GT(compare_with_reference(before, now, grid_of_tracks(160, 160, 24, 9)), 100); });
}

// Strong patches of 0 and 255, blocks and stripes of every period at every alignment: the sums of 16-bit products come
// nearest to their limits here.
TEST(Klt, OneStepSolvesTheLeastSquaresOnBlackAndWhiteAtAllAlignments) {
  on_every_target([&] {
    int compared = 0;
    for (int period : {3, 4, 5, 7, 8, 11, 16, 23}) {
      TestImage before(96, 96), now(96, 96);
      const auto pattern = [&](int x, int y) { return ((x / period) ^ (y / period)) % 2 ? 255 : 0; };
      before.fill(pattern);
      now.fill([&](int x, int y) { return pattern(x, y + (period > 4 ? 1 : 0)); });
      std::vector<KltTrack> tracks;
      for (int y = 0; y < 24; ++y) {
        for (int x = 0; x < 24; ++x) tracks.push_back(at(30 + x + x / 24.0, 30 + y + y / 31.0));
      }
      compared += compare_with_reference(before, now, tracks);
    }
    EXPECT_GT(compared, 1000);
  });
}

TEST(Klt, OneStepSolvesTheLeastSquaresOnBlackAgainstWhite) {
  std::mt19937 random(7);
  on_every_target([&] {
    int compared = 0;
    for (int round = 0; round < 20; ++round) {
      TestImage before(64, 64), now(64, 64);
      std::bernoulli_distribution coin(0.5);
      before.fill([&](int, int) { return coin(random) ? 255 : 0; });
      now = before;
      // A quarter of the pixels turned over: errors of full range that the step must still average rightly.
      for (auto& p : now.pixels) p = static_cast<std::uint8_t>(coin(random) && coin(random) ? 255 - p : p);
      compared += compare_with_reference(before, now, grid_of_tracks(64, 64, 20, 3));
    }
    EXPECT_GT(compared, 300);
  });
}

RC_GTEST_PROP(Klt, OneStepSolvesTheLeastSquaresAnywhere, ()) {
  std::mt19937 random(*rc::gen::arbitrary<unsigned>());
  std::uniform_real_distribution<double> unit(0, 1);
  const TestImage before = random_image(80, 80, random, 80 + static_cast<int>(random() % 40));
  TestImage now = before;
  const double contrast = 0.3 + unit(random), bias = 60 * unit(random) - 30, noise = 30 * unit(random);
  now.fill(
      [&](int x, int y) { return contrast * (before.at(x, y) - 128) + 128 + bias + noise * (unit(random) - 0.5); });
  std::vector<KltTrack> tracks;
  for (int k = 0; k < 10; ++k) {
    tracks.push_back(at(20 + 40 * unit(random), 20 + 40 * unit(random)));
    tracks.back().found_x += static_cast<float>(unit(random) - 0.5);
    tracks.back().found_y += static_cast<float>(unit(random) - 0.5);
  }
  compare_with_reference(before, now, tracks);
  RC_ASSERT(!::testing::Test::HasFailure());
}

TEST(Klt, FindsKnownShiftsAcrossTheLevels) {
  const Waves waves(11);
  on_every_target([&] {
    const TestImage before = shifted(waves, 320, 240, 0, 0);
    for (const auto& [dx, dy] : {std::pair{0.0, 0.0}, {0.25, -0.5}, {3.7, 2.2}, {-9.3, 6.1}}) {
      auto tracks = grid_of_tracks(320, 240, 80, 11);
      track({}, before, shifted(waves, 320, 240, dx, dy), tracks);
      EXPECT_LT(rms_error(tracks, dx, dy), 0.015) << "shift " << dx << ", " << dy;
    }
  });
}

TEST(Klt, GainAndBiasDoNotMatter) {
  const Waves waves(12);
  const TestImage before = shifted(waves, 320, 240, 0, 0);
  on_every_target([&] {
    for (const auto& [gain, bias] : {std::pair{0.6, 12.0}, {0.4, 80.0}, {1.25, -30.0}}) {
      auto tracks = grid_of_tracks(320, 240, 40, 17);
      track({}, before, shifted(waves, 320, 240, 3.3, -2.6, gain, bias), tracks);
      EXPECT_LT(rms_error(tracks, 3.3, -2.6), 0.02) << "gain " << gain;
    }
  });
}

// The same features, the same images, one rival: no less accurate than OpenCV's 21x21 tracker allows for the smaller
// patch.
TEST(Klt, IsAboutAsAccurateAsOpenCv) {
  const Waves waves(13, 5, 40);
  std::mt19937 random(13);
  for (double noise : {0.0, 3.0}) {
    std::normal_distribution<double> grain(0, std::max(noise, 1e-9));
    TestImage before(320, 240), now(320, 240);
    before.fill([&](int x, int y) { return waves(x, y) + grain(random); });
    now.fill([&](int x, int y) { return waves(x - 2.35, y + 1.6) + grain(random); });
    auto tracks = grid_of_tracks(320, 240, 40, 13);
    track({}, before, now, tracks);
    std::vector<cv::Point2f> old, found;
    for (const KltTrack& t : tracks) old.emplace_back(t.x, t.y);
    std::vector<std::uint8_t> status;
    std::vector<float> error;
    cv::calcOpticalFlowPyrLK(cv::Mat(240, 320, CV_8UC1, before.pixels.data()),
                             cv::Mat(240, 320, CV_8UC1, now.pixels.data()), old, found, status, error, {21, 21}, 3);
    double sum = 0;
    for (std::size_t k = 0; k < old.size(); ++k) {
      sum += std::pow(found[k].x - old[k].x - 2.35, 2) + std::pow(found[k].y - old[k].y + 1.6, 2);
    }
    const double rival = std::sqrt(sum / (2 * static_cast<double>(old.size())));
    EXPECT_LT(rms_error(tracks, 2.35, -1.6), 1.4 * rival + 0.005) << "noise " << noise << ", OpenCV " << rival;
  }
}

TEST(Klt, AStartLevelChangesTheWorkNotTheResult) {
  const Waves waves(14);
  const TestImage before = shifted(waves, 320, 240, 0, 0), now = shifted(waves, 320, 240, 1.2, 0.7);
  for (int level = 0; level < 6; ++level) {
    auto tracks = grid_of_tracks(320, 240, 40, 17);
    for (auto& t : tracks) t.start_level = level;
    track({}, before, now, tracks);
    EXPECT_LT(rms_error(tracks, 1.2, 0.7), 0.015) << "level " << level;
  }
}

TEST(Klt, AFailureAtAFineLevelIsTriedFromTheCoarsest) {
  const Waves waves(15, 12, 80);
  const TestImage before = shifted(waves, 320, 240, 0, 0), now = shifted(waves, 320, 240, 13.2, -10.7);
  auto tracks = grid_of_tracks(320, 240, 80, 11);
  for (auto& t : tracks) t.start_level = 0;
  track({}, before, now, tracks);
  const auto right = std::count_if(tracks.begin(), tracks.end(), [](const KltTrack& t) {
    return t.end == KltEnd::kFound && std::hypot(t.found_x - t.x - 13.2, t.found_y - t.y + 10.7) < 0.1;
  });
  EXPECT_GT(static_cast<double>(right), 0.9 * static_cast<double>(tracks.size()));
}

TEST(Klt, EndsAtTheBorderWhereverThePatchDoesNotFit) {
  std::mt19937 random(16);
  const TestImage image = random_image(100, 80, random);  // its own twin: every patch inside matches perfectly
  on_every_target([&] {
    std::vector<KltTrack> tracks;
    for (double y = -30; y < 110; y += 1.75) {
      for (double x = -30; x < 130; x += 1.75) tracks.push_back(at(x, y));
    }
    track({}, image, image, tracks);
    for (const KltTrack& t : tracks) {
      const bool inside = t.x >= 9 && t.y >= 9 && t.x <= 100 - 11 && t.y <= 80 - 11;
      const bool outside = t.x < 8 || t.y < 8 || t.x > 100 - 9 || t.y > 80 - 9;
      if (!inside && !outside) continue;
      ASSERT_EQ(t.end, inside ? KltEnd::kFound : KltEnd::kBorder) << t.x << ", " << t.y;
    }
  });
}

TEST(Klt, PositionsThatAreNoNumbersEndAtTheBorder) {
  const Waves waves(17);
  const TestImage image = shifted(waves, 100, 100, 0, 0);
  const float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
  std::vector<KltTrack> tracks(4, at(50, 50));
  tracks[0].x = nan;
  tracks[1].found_y = nan;
  tracks[2].found_x = infinity;
  tracks[3].y = -infinity;
  track({}, image, image, tracks);
  for (const KltTrack& t : tracks) EXPECT_EQ(t.end, KltEnd::kBorder);
}

TEST(Klt, WithoutTextureATrackIsFlat) {
  TestImage grey(100, 100), edge(100, 100);
  grey.fill([](int, int) { return 77; });
  edge.fill([](int x, int) { return x < 50 ? 20 : 200; });  // says nothing along the edge
  on_every_target([&] {
    for (const TestImage* image : {&grey, &edge}) {
      std::vector<KltTrack> tracks{at(50, 50)};
      track({}, *image, *image, tracks);
      EXPECT_EQ(tracks[0].end, KltEnd::kFlat);
    }
  });
}

TEST(Klt, UnrelatedImagesDoNotMatch) {
  const Waves a(18, 4, 16), b(19, 4, 16);
  auto tracks = grid_of_tracks(320, 240, 30, 9);
  track({}, shifted(a, 320, 240, 0, 0), shifted(b, 320, 240, 0, 0), tracks);
  const auto found =
      std::count_if(tracks.begin(), tracks.end(), [](const KltTrack& t) { return t.end == KltEnd::kFound; });
  EXPECT_LT(static_cast<double>(found), 0.03 * static_cast<double>(tracks.size()));
}

TEST(Klt, EachCheckCanEndATrack) {
  const Waves waves(20, 5, 30);
  std::mt19937 random(20);
  std::normal_distribution<double> grain(0, 25);
  TestImage before = shifted(waves, 200, 200, 0, 0), now(200, 200);
  now.fill([&](int x, int y) { return waves(x - 0.5, y) + grain(random); });
  const auto ends = [&](const TrackerConfig& config) {
    auto tracks = grid_of_tracks(200, 200, 30, 15);
    track(config, before, now, tracks);
    std::vector<int> count(6);
    for (const KltTrack& t : tracks) ++count[static_cast<std::size_t>(t.end)];
    return count;
  };
  TrackerConfig strict;
  strict.min_correlation = 0.999f;
  EXPECT_EQ(ends(strict)[static_cast<std::size_t>(KltEnd::kFound)], 0);
  EXPECT_GT(ends(strict)[static_cast<std::size_t>(KltEnd::kCorrelation)], 50);
  strict = {};
  strict.max_backward_px = 0;
  EXPECT_GT(ends(strict)[static_cast<std::size_t>(KltEnd::kBackward)], 50);
  strict = {};
  strict.max_step_px = 0.01f;
  EXPECT_GT(ends(strict)[static_cast<std::size_t>(KltEnd::kDiverged)], 50);
}

}  // namespace
}  // namespace epiline
