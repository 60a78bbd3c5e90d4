#include "pipeline/vision/tracker.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <Eigen/Dense>
#include <limits>
#include <map>
#include <memory>
#include <set>
#include <stdexcept>
#include <vector>

#include "platform/memory/allocation_count.h"
#include "tests/pipeline/vision/support.h"

namespace epiline {
namespace {

Camera camera_of(int width, int height) {
  CameraParameters p;
  p.width = width;
  p.height = height;
  p.intrinsics = {0.6 * width, 0.61 * width, 0.49 * width, 0.51 * height};
  p.distortion = {-0.1, 0.02, 1e-4, -2e-4, 0};
  return Camera(p);
}

/// A tracker with a world that slides past by (dx, dy) px an image. Keeps the last two images, as the contract asks.
class Slide {
 public:
  Slide(int width, int height, const TrackerConfig& config = {})
      : width_(width), height_(height), tracker(camera_of(width, height), config), waves_(31, 5, 40) {}

  const TrackedFrame& show(double dx, double dy, double gain = 1, double bias = 0, int images_later = 1) {
    x_ += dx;
    y_ += dy;
    number_ += images_later;
    previous_ = std::move(image_);
    image_ = std::make_unique<TestImage>(shifted(waves_, width_, height_, x_, y_, gain, bias));
    tracker.step(frame_of(*image_, number_), Mat3::Identity(), *out);
    return *out;
  }
  const TrackedFrame& show(const TestImage& image) {
    tracker.step(frame_of(image, ++number_), Mat3::Identity(), *out);
    return *out;
  }

 private:
  int width_, height_;

 public:
  Tracker tracker;
  std::unique_ptr<TrackedFrame> out = std::make_unique<TrackedFrame>();

 private:
  Waves waves_;
  double x_ = 0, y_ = 0;
  int number_ = 0;
  std::unique_ptr<TestImage> image_, previous_;
};

TEST(Tracker, FollowsASlidingWorld) {
  Slide slide(320, 240);
  std::map<std::uint32_t, TrackedFeature> last;
  double error2 = 0;
  int count = 0;
  for (int image = 0; image < 20; ++image) {
    const TrackedFrame& frame = slide.show(2.3, -1.1);
    for (const TrackedFeature& f : frame.features) {
      const auto before = last.find(f.id);
      EXPECT_EQ(before == last.end(), f.age == 0) << "a track that was not in the last image must be new";
      if (before == last.end()) continue;
      EXPECT_EQ(f.age, before->second.age + 1);
      EXPECT_NEAR(f.velocity_px_s[0], (f.pixel[0] - before->second.pixel[0]) * 20, 1e-2);
      EXPECT_NEAR(f.velocity_px_s[1], (f.pixel[1] - before->second.pixel[1]) * 20, 1e-2);
      error2 += std::pow(f.velocity_px_s[0] / 20 - 2.3, 2) + std::pow(f.velocity_px_s[1] / 20 + 1.1, 2);
      ++count;
    }
    last.clear();
    for (const TrackedFeature& f : frame.features) last[f.id] = f;
  }
  EXPECT_LT(std::sqrt(error2 / (2 * count)), 0.03);
  const TrackerStats& stats = slide.tracker.stats();
  EXPECT_GT(static_cast<double>(stats.tracked), 0.93 * static_cast<double>(stats.tried));
  EXPECT_EQ(stats.images, 20u);
}

TEST(Tracker, BearingsAndJacobiansAreTheCameras) {
  const Camera camera = camera_of(320, 240);
  Slide slide(320, 240);
  slide.show(0, 0);
  for (const TrackedFeature& f : slide.show(1, 1).features) {
    Vec3 bearing;
    Mat23 J;
    ASSERT_TRUE(camera.bearing(Vec2(f.pixel[0], f.pixel[1]), bearing, J));
    EXPECT_LT((bearing - Vec3(f.bearing.data())).norm(), 1e-12);
    EXPECT_LT((J - Eigen::Map<const Eigen::Matrix<double, 2, 3, Eigen::RowMajor>>(f.pixel_jacobian.data())).norm(),
              1e-9);
  }
}

TEST(Tracker, ExposureChangesDoNotEndTracks) {
  Slide slide(320, 240);
  slide.show(0, 0);
  for (int k = 0; k < 8; ++k) slide.show(1.5, 0.5, k % 2 ? 1 : 0.6, k % 2 ? 0 : 12);
  const TrackerStats& stats = slide.tracker.stats();
  EXPECT_GT(static_cast<double>(stats.tracked), 0.93 * static_cast<double>(stats.tried));
}

TEST(Tracker, ADroppedImageDoesNotEndTracks) {
  Slide slide(320, 240);
  for (int k = 0; k < 5; ++k) slide.show(3, 2);
  const TrackerStats before = slide.tracker.stats();
  slide.show(9, 6, 1, 0, 3);  // two images are missing
  const TrackerStats& after = slide.tracker.stats();
  EXPECT_EQ(after.gaps, before.gaps + 1);
  EXPECT_GT(static_cast<double>(after.tracked - before.tracked),
            0.85 * static_cast<double>(after.tried - before.tried));
  int old = 0;
  for (const TrackedFeature& f : slide.out->features) {
    if (f.age == 0) continue;
    ++old;
    EXPECT_NEAR(f.velocity_px_s[0], 60, 3) << "of the whole pause, not of one image";
  }
  EXPECT_GT(old, 60);
}

// The gyroscope's rotation leads to places that four levels alone cannot reach.
TEST(Tracker, RotationPredictsLargeMotion) {
  const Camera camera = camera_of(320, 240);
  const Waves waves(32, 4, 15);
  const Mat3 R = Eigen::AngleAxisd(0.15, Vec3(0.2, 1, 0.3).normalized()).toRotationMatrix();  // about 29 px
  TestImage before = shifted(waves, 320, 240, 0, 0), now(320, 240);
  now.fill([&](int x, int y) {
    Vec3 f;
    Vec2 px(-1e3, -1e3);
    return camera.unproject({x, y}, f) && camera.project(R.transpose() * f, px) ? waves(px.x(), px.y()) : 0;
  });
  const auto tracked = [&](const Mat3& prediction) {
    Tracker tracker(camera, {});
    auto out = std::make_unique<TrackedFrame>();
    tracker.step(frame_of(before, 1), Mat3::Identity(), *out);
    tracker.step(frame_of(now, 2), prediction, *out);
    return static_cast<double>(tracker.stats().tracked) / static_cast<double>(tracker.stats().tried);
  };
  EXPECT_GT(tracked(R), 0.6);
  EXPECT_LT(tracked(Mat3::Identity()), 0.2);
  EXPECT_LT(tracked(R.transpose()), 0.2);
}

// In a blow it reads turns that never were.
TEST(Tracker, AGyroscopeThatWasHitEndsNoTracks) {
  const Waves waves(31, 5, 40);
  TestImage before = shifted(waves, 320, 240, 0, 0), now = shifted(waves, 320, 240, 2, -1);
  for (const double angle : {0.03, 0.1, 0.3}) {
    const Mat3 R = Eigen::AngleAxisd(angle, Vec3(0.2, 1, 0.3).normalized()).toRotationMatrix();
    Tracker tracker(camera_of(320, 240), {});
    auto out = std::make_unique<TrackedFrame>();
    tracker.step(frame_of(before, 1), Mat3::Identity(), *out);
    tracker.step(frame_of(now, 2), R, *out);
    EXPECT_GT(static_cast<double>(tracker.stats().tracked), 0.85 * static_cast<double>(tracker.stats().tried))
        << angle << " rad";
    for (const TrackedFeature& f : out->features) {
      if (f.age > 0) {
        EXPECT_NEAR(f.velocity_px_s[0], 40, 4) << angle << " rad";
      }
    }
  }
}

// What begins in a world that is fast already has no history of its own.
TEST(Tracker, NewTracksMoveAsTheirNeighbours) {
  Slide slide(320, 240);
  std::set<std::uint32_t> began;
  double speed = 0;
  int tried = 0, followed = 0;
  for (int image = 0; image < 22; ++image) {
    speed = std::min(speed + 2, 26.);  // px an image; a long way beyond the waves of 5 to 40 px
    const TrackedFrame& frame = slide.show(speed, 0);
    if (image > 14) tried += static_cast<int>(began.size());
    std::set<std::uint32_t> begins;
    for (const TrackedFeature& f : frame.features) {
      if (f.age == 0) begins.insert(f.id);
      if (image > 14 && began.count(f.id) > 0 && std::abs(f.velocity_px_s[0] / 20 - speed) < 0.5) ++followed;
    }
    began = begins;
  }
  ASSERT_GT(tried, 50);
  EXPECT_GT(followed, 0.8 * tried) << followed << " of " << tried;
}

TEST(Tracker, ABlankImageEndsAllTracksAndALaterOneBeginsAgain) {
  Slide slide(320, 240);
  slide.show(0, 0);
  const std::size_t count = slide.show(1, 1).features.size();
  TestImage blank(320, 240);
  EXPECT_EQ(slide.show(blank).features.size(), 0u);
  EXPECT_EQ(slide.show(blank).features.size(), 0u);
  const TrackedFrame& again = slide.show(1, 1);
  EXPECT_GT(again.features.size(), 60u);
  for (const TrackedFeature& f : again.features) EXPECT_GE(f.id, count);
}

TEST(Tracker, EveryTrackThatWasTriedIsCountedOnce) {
  Slide slide(320, 240);
  const TrackerStats& s = slide.tracker.stats();
  for (int k = 0; k < 10; ++k) slide.show(5, 3);
  EXPECT_EQ(s.lost_flat, 0u) << "every feature of this world has texture";
  for (double gain = 1; gain > 0.01; gain *= 0.7) slide.show(1, 1, gain, 100 * (1 - gain));
  EXPECT_GT(s.lost_flat, 0u) << "until it fades";
  slide.show(TestImage(320, 240));
  EXPECT_EQ(s.tried, s.tracked + s.lost_border + s.lost_flat + s.lost_diverged + s.lost_correlation + s.lost_backward +
                         s.rejected_near + s.rejected_wide);
}

TEST(Tracker, RefusesImagesThatAreNotTheCameras) {
  Slide slide(320, 240);
  slide.show(0, 0);
  TestImage image(320, 240), small(318, 240);
  Frame bad[] = {frame_of(small, 5), frame_of(image, 6), frame_of(image, 7)};
  bad[1].data = nullptr;
  bad[2].stride = 319;
  for (const Frame& frame : bad) {
    slide.tracker.step(frame, Mat3::Identity(), *slide.out);
    EXPECT_TRUE(slide.out->features.empty());
  }
  EXPECT_EQ(slide.tracker.stats().images_refused, 3u);
  const TrackedFrame& frame = slide.show(0, 0, 1, 0, 10);
  EXPECT_GT(frame.features.size(), 60u);
  for (const TrackedFeature& f : frame.features) EXPECT_EQ(f.age, 0u);
}

TEST(Tracker, ARotationThatIsNoNumberCountsAsUnknown) {
  Slide slide(320, 240);
  slide.show(0, 0);
  TestImage image = shifted(Waves(31, 5, 40), 320, 240, 1, 1);
  slide.tracker.step(frame_of(image, 2), Mat3::Constant(std::numeric_limits<double>::quiet_NaN()), *slide.out);
  EXPECT_GT(slide.tracker.stats().tracked, 50u);
}

TEST(Tracker, StampsThatStandStillGiveNoVelocity) {
  Slide slide(320, 240);
  slide.show(0, 0);
  for (const TrackedFeature& f : slide.show(1, 1, 1, 0, 0).features) {
    EXPECT_EQ(f.velocity_px_s, (std::array<float, 2>{0, 0}));
  }
}

TEST(Tracker, ConstantsOutOfRangeAreRefused) {
  const Camera camera = camera_of(320, 240);
  const auto with = [&](auto change) {
    TrackerConfig config;
    change(config);
    Tracker tracker(camera, config);
  };
  EXPECT_NO_THROW(with([](TrackerConfig&) {}));
  EXPECT_THROW(with([](TrackerConfig& c) { c.max_features = 0; }), std::invalid_argument);
  EXPECT_THROW(with([](TrackerConfig& c) { c.max_features = 401; }), std::invalid_argument);
  EXPECT_THROW(with([](TrackerConfig& c) { c.levels = 7; }), std::invalid_argument);
  EXPECT_THROW(with([](TrackerConfig& c) { c.wide_span = 8; }), std::invalid_argument);
  EXPECT_THROW(with([](TrackerConfig& c) { c.border_px = 3; }), std::invalid_argument);
  EXPECT_THROW(with([](TrackerConfig& c) { c.border_px = 115; }), std::invalid_argument);
  EXPECT_THROW(Tracker(camera_of(63, 240), {}), std::invalid_argument);
}

TEST(Tracker, EverySizeWorks) {
  on_every_target([&] {
    for (const auto& [width, height] : {std::pair{64, 64}, {65, 131}, {320, 240}, {641, 479}, {2048, 1536}}) {
      SCOPED_TRACE(width);
      Slide slide(width, height);
      slide.show(0, 0);
      const TrackedFrame& frame = slide.show(1.5, -0.5);
      const auto old =
          std::count_if(frame.features.begin(), frame.features.end(), [](const auto& f) { return f.age == 1; });
      EXPECT_GT(old, width == 2048 ? 140 : width * height / 3000);
      for (const TrackedFeature& f : frame.features) {
        EXPECT_TRUE(f.pixel[0] > 7 && f.pixel[0] < static_cast<float>(width - 8));
        EXPECT_TRUE(f.pixel[1] > 7 && f.pixel[1] < static_cast<float>(height - 8));
      }
    }
  });
}

TEST(Tracker, NoiseOfExtremesIsSurvived) {
  std::mt19937 random(33);
  std::bernoulli_distribution coin(0.5);
  Slide slide(160, 120);
  TestImage images[2] = {{160, 120, 171}, {160, 120, 171}};
  for (int k = 0; k < 20; ++k) {
    TestImage& image = images[k % 2];
    for (auto& p : image.pixels) p = coin(random) ? 255 : 0;
    EXPECT_LE(slide.show(image).features.size(), 150u);
  }
}

TEST(Tracker, StepDoesNotAllocate) {
  if (!allocation_counting_available()) GTEST_SKIP() << "heap calls are not counted in this build";
  const Waves waves(34, 5, 40);
  std::vector<TestImage> images;
  for (int k = 0; k < 12; ++k) images.push_back(k == 6 ? TestImage(320, 240) : shifted(waves, 320, 240, 1.7 * k, k));
  Tracker tracker(camera_of(320, 240), {});
  auto out = std::make_unique<TrackedFrame>();
  const HeapCallScope scope;
  for (int k = 0; k < 12; ++k) tracker.step(frame_of(images[static_cast<std::size_t>(k)], k), Mat3::Identity(), *out);
  EXPECT_EQ(scope.calls(), 0u);
  EXPECT_GT(tracker.stats().tracked, 100u);
}

bool same(const TrackedFrame& a, const TrackedFrame& b) {
  return a.features.size() == b.features.size() &&
         std::equal(a.features.begin(), a.features.end(), b.features.begin(), [](const auto& x, const auto& y) {
           return x.id == y.id && x.age == y.age && x.pixel == y.pixel && x.velocity_px_s == y.velocity_px_s &&
                  x.bearing == y.bearing && x.pixel_jacobian == y.pixel_jacobian;
         });
}

RC_GTEST_PROP(Tracker, KeepsItsPromisesOnAnyMotion, ()) {
  TrackerConfig config;
  config.max_features = *rc::gen::inRange(1, 200);
  const int width = *rc::gen::inRange(64, 240), height = *rc::gen::inRange(64, 200);
  Slide slide(width, height, config), twin(width, height, config);
  std::map<std::uint32_t, std::uint32_t> age;  // of the last image
  std::int64_t newest = -1;
  for (int image = 0; image < 6; ++image) {
    const double dx = *rc::gen::inRange(-100, 100) / 10.0, dy = *rc::gen::inRange(-100, 100) / 10.0;
    const double gain = *rc::gen::inRange(2, 13) / 10.0;
    const int later = *rc::gen::inRange(1, 4);
    const TrackedFrame& frame = slide.show(dx, dy, gain, 10, later);
    RC_ASSERT(same(frame, twin.show(dx, dy, gain, 10, later)));
    RC_ASSERT(static_cast<int>(frame.features.size()) <= config.max_features);
    RC_ASSERT(frame.stamp.ns == 50'000'000LL * static_cast<std::int64_t>(frame.sequence));
    std::map<std::uint32_t, std::uint32_t> now;
    for (const TrackedFeature& f : frame.features) {
      const bool increasing = now.empty() || f.id > now.rbegin()->first;
      RC_ASSERT(increasing);
      if (f.age == 0) {
        RC_ASSERT(static_cast<std::int64_t>(f.id) > newest);
      } else {
        const bool one_older = age.contains(f.id) && age[f.id] + 1 == f.age;
        RC_ASSERT(one_older);
      }
      RC_ASSERT(f.pixel[0] > 7 && f.pixel[1] > 7 && f.pixel[0] < static_cast<float>(width) - 8);
      RC_ASSERT(f.pixel[1] < static_cast<float>(height) - 8);
      now[f.id] = f.age;
    }
    if (!now.empty()) newest = std::max<std::int64_t>(newest, now.rbegin()->first);
    age = now;
    for (const TrackedFeature& f : frame.features) {
      for (const TrackedFeature& g : frame.features) {
        const bool apart =
            std::hypot(f.pixel[0] - g.pixel[0], f.pixel[1] - g.pixel[1]) > config.min_distance_px - 1e-3f;
        const bool allowed = f.age > 0 || f.id == g.id || apart;
        RC_ASSERT(allowed);
      }
    }
  }
}

/// A camera that shakes, moves sideways along a wall and exposes its rows one after the other.
/// Returns the share of tracks that the tracker rejects.
double rejected_share(double readout_s, bool known) {
  CameraParameters p;
  p.width = 320;
  p.height = 240;
  p.intrinsics = {250, 250, 159.5, 119.5};
  const Camera global(p);
  p.readout_s = readout_s;
  const Camera rolling(p);
  const Waves waves(31, 5, 40);
  const auto R_WC = [](double t) { return so3_exp({0.03 * std::sin(37 * t), 0.02 * std::sin(29 * t), 0}); };
  Tracker tracker(known ? rolling : global, {});
  TrackedFrame out;
  std::vector<std::unique_ptr<TestImage>> images;
  for (int n = 1; n <= 12; ++n) {
    const double t = 0.05 * n, half_s = 0.5 * readout_s;
    images.push_back(std::make_unique<TestImage>(p.width, p.height));
    images.back()->fill([&](int x, int y) {
      Vec3 f_C;
      rolling.unproject(Vec2(x, y), f_C);
      const double row_t = t + rolling.row_s(y);
      const Vec3 f_W = R_WC(row_t) * f_C;
      return waves(250 * (f_W.x() / f_W.z() + 0.3 * row_t), 250 * f_W.y() / f_W.z());
    });
    const Mat3 R_CC0 = R_WC(t).transpose() * R_WC(t - 0.05);
    const RowTurn rows = known ? row_turn(R_WC(t - half_s).transpose() * R_WC(t),
                                          R_WC(t).transpose() * R_WC(t + half_s), half_s, Mat3::Identity())
                               : RowTurn{};
    tracker.step(frame_of(*images.back(), n), R_CC0, out, rows);
  }
  const TrackerStats& stats = tracker.stats();
  return static_cast<double>(stats.rejected_near + stats.rejected_wide) / static_cast<double>(stats.tried);
}

TEST(Tracker, RowsOfARollingShutterAreNoOutliers) {
  const double known = rejected_share(0.03, true), unknown = rejected_share(0.03, false);
  EXPECT_LT(known, 0.01);
  EXPECT_GT(unknown, 0.05);
}

}  // namespace
}  // namespace epiline
