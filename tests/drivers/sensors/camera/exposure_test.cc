// The exposure controller and the timeline against a camera played with arithmetic.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "tests/drivers/sensors/camera/simulated_camera.h"

namespace epiline {
namespace {

double between(double least, double most) { return least + (most - least) * *rc::gen::inRange(0, 1001) / 1000.; }
double between_log(double least, double most) { return std::exp(between(std::log(least), std::log(most))); }

const ExposureLimits kWide{.gain_most = 16};

PlayedSensor any_sensor() {
  return {.gamma = between(0.45, 1.2), .black = between(0, 10), .delay = *rc::gen::inRange(0, 5)};
}

/// Changes of direction of the exposure that was asked for.
class Reversals {
 public:
  void see(double total) {
    const int direction = total > last_ * 1.001 ? 1 : total < last_ / 1.001 ? -1 : 0;
    if (last_ > 0 && direction != 0) {
      if (direction == -direction_) ++count_;
      direction_ = direction;
    }
    last_ = total;
  }
  int count() const { return count_; }

 private:
  double last_ = 0;
  int direction_ = 0, count_ = 0;
};

/// A level of light at which the middle of the limits is about right.
PlayedScene any_scene(double window) {
  return PlayedScene(between_log(100 / 0.05, 100 / 0.0004), between(0.1, 0.8), window, between(1, 20),
                     *rc::gen::inRange(0u, 1000u));
}

RC_GTEST_PROP(ExposureController, SettlesFromAnyStart, ()) {
  const bool has_window = *rc::gen::arbitrary<bool>();
  const PlayedScene scene = any_scene(has_window ? between(0.02, 0.3) : 0);
  const ExposureState start{Span{static_cast<std::int64_t>(between_log(20e3, 10e6))}, between_log(1, 16)};
  PlayedCamera camera(any_sensor(), kWide, start, -1);
  Reversals reversals;
  for (int i = 0; i < 250; ++i) reversals.see(camera.step(scene).shown.total());
  RC_ASSERT(reversals.count() <= 5);  // swinging would be 50
  int changes = 0;
  double wanted = 0;
  ExposureState last;
  for (int i = 0; i < 60; ++i) {
    const auto image = camera.step(scene);
    changes += image.is_changed ? 1 : 0;
    wanted += image.wanted() / 60;
    last = image.shown;
  }
  // now and then it tries again whether a bright window can be had, and comes back; swinging would be 8
  RC_ASSERT(changes <= (has_window ? 3 : 0));
  const bool is_at_limit = last.total() > 0.0098 * 16 * 0.98 || last.total() < 21e-6;
  RC_ASSERT(is_at_limit || std::abs(wanted) < (has_window ? 0.95 : 0.32));
}

// Steps of light, with a delay that was configured one image too short or too long.
RC_GTEST_PROP(ExposureController, FollowsStepsOfLightWithoutSwinging, ()) {
  PlayedSensor sensor = any_sensor();
  const int configured = std::max(0, sensor.delay + *rc::gen::inRange(-1, 2));
  const PlayedScene scene(100 / 0.004, between(0.1, 0.8), 0, 1, *rc::gen::inRange(0u, 1000u));
  PlayedCamera camera(sensor, kWide, {Span{4'000'000}, 1}, configured);
  for (int i = 0; i < 120; ++i) camera.step(scene);
  for (const double light : {between_log(0.1, 10), between_log(0.1, 10)}) {
    Reversals reversals;
    double wanted = 0;
    for (int i = 0; i < 130; ++i) {
      const auto image = camera.step(scene, light);
      if (i > 3) reversals.see(image.shown.total());
      if (i >= 100) wanted += image.wanted() / 30;
    }
    RC_ASSERT(reversals.count() <= 1);
    RC_ASSERT(std::abs(wanted) < 0.32);
  }
}

RC_GTEST_PROP(ExposureController, LampsThatFlickerDoNotMoveIt, ()) {
  PlayedSensor sensor = any_sensor();
  sensor.flicker = between(0, 0.3);
  sensor.rate_hz = *rc::gen::element(20., 30., 60., 29.97);
  const PlayedScene scene(100 / 0.004, 0.4, 0, 1, 5);
  PlayedCamera camera(sensor, kWide, {Span{4'000'000}, 1}, -1);
  for (int i = 0; i < 150; ++i) camera.step(scene);
  int changes = 0;
  for (int i = 0; i < 150; ++i) changes += camera.step(scene).is_changed ? 1 : 0;
  RC_ASSERT(changes <= 2);
}

TEST(ExposureController, GoesToItsLimitsInTheDarkAndInTheSunAndStaysThere) {
  for (const double level : {0., 1e9}) {
    PlayedCamera camera({}, kWide, {Span{1'000'000}, 2}, 1);
    const PlayedScene scene(level, 0.5, 0, 1, 1);
    for (int i = 0; i < 200; ++i) camera.step(scene);
    const auto image = camera.step(scene);
    EXPECT_EQ(image.shown.time.ns, level > 0 ? 20'000 : 10'000'000);
    EXPECT_DOUBLE_EQ(image.shown.gain, level > 0 ? 1 : 16);
    EXPECT_FALSE(image.is_changed);
  }
}

// Against OpenCV's corners of all exposures: few are missed, also with a window in the picture.
RC_GTEST_PROP(ExposureController, TheImageHasNearlyAsManyCornersAsAnyOther, ()) {
  const double window = *rc::gen::element(0., 0.1, 0.2);
  const PlayedScene scene(100 / 0.004, between(0.4, 0.8), window, between(2, 10), *rc::gen::inRange(0u, 1000u));
  const PlayedSensor sensor{.gamma = between(0.7, 1)};
  PlayedCamera camera(sensor, kWide, {Span{static_cast<std::int64_t>(between_log(20e3, 10e6))}, 1}, 1);
  for (int i = 0; i < 300; ++i) camera.step(scene);
  std::mt19937 random(3);
  const auto corners = [&](double total) {
    auto pixels = picture(scene, sensor, total, random);
    const cv::Mat image(PlayedScene::kHeight, PlayedScene::kWidth, CV_8U, pixels.data());
    cv::Mat score;
    cv::cornerMinEigenVal(image, score, 5, 3);
    return cv::countNonZero(score > 2e-3);
  };
  int most = 0;
  for (double total = 20e-6; total < 0.16; total *= 1.2) most = std::max(most, corners(total));
  RC_ASSERT(corners(camera.step(scene).shown.total()) > 0.75 * most);
}

TEST(ExposureController, TurningMakesExposuresShortAndGainMakesUpForIt) {
  PlayedCamera camera({}, {.gain_most = 16, .blur_px = 2, .focal_px = 400}, {Span{8'000'000}, 1}, 1);
  const PlayedScene scene(100 / 0.008, 0.4, 0, 1, 1);
  for (int i = 0; i < 100; ++i) camera.step(scene);
  const double before = camera.step(scene).shown.total();
  EXPECT_GT(camera.step(scene).shown.time.ns, 5'000'000);
  PlayedCamera::Image image;
  for (int i = 0; i < 30; ++i) image = camera.step(scene, 1, 2.5);
  EXPECT_LE(image.shown.time.ns, 2'200'000) << "2 px at 1000 px/s";
  EXPECT_NEAR(image.shown.total() / before, 1, 0.3);
  for (int i = 0; i < 300; ++i) image = camera.step(scene);
  EXPECT_GT(image.shown.time.ns, 5'000'000) << "calm again";
}

TEST(ExposureController, LongExposuresAreWholePeriodsOfTheLamps) {
  const ExposureController controller({.longest = Span{35'000'000}, .gain_most = 16, .flicker_hz = 100});
  EXPECT_EQ(controller.split(0.025).time.ns, 20'000'000);
  EXPECT_NEAR(controller.split(0.025).gain, 1.25, 1e-9);
  EXPECT_EQ(controller.split(0.010).time.ns, 10'000'000);
  EXPECT_EQ(controller.split(0.004).time.ns, 4'000'000);
}

// The delay of the camera is found, and from then on every image's exposure is known.
RC_GTEST_PROP(ExposureTimeline, LearnsTheDelayOfTheCamera, ()) {
  PlayedSensor sensor = any_sensor();
  sensor.black = 0;
  const PlayedScene scene(100 / 0.004, between(0.2, 0.6), 0, 1, *rc::gen::inRange(0u, 1000u));
  PlayedCamera camera(sensor, kWide, {Span{400'000}, 1}, -1);
  for (int i = 0; i < 400; ++i) camera.step(scene, i / 40 % 2 == 0 ? 1 : 3);
  RC_ASSERT(camera.timeline().is_delay_known());
  RC_ASSERT(camera.timeline().delay() == sensor.delay);
  for (int i = 0; i < 100; ++i) {
    const auto image = camera.step(scene, i / 40 % 2 == 0 ? 0.3 : 1);
    RC_ASSERT(image.believed.time == image.shown.time);
  }
}

RC_GTEST_PROP(ExposureTimeline, LostImagesDoNotMoveAChange, ()) {
  const int delay = *rc::gen::inRange(0, 5);
  ExposureTimeline timeline(delay);
  timeline.begin({Span{1'000}, 1});
  const std::int64_t period = 20'000'000;
  const std::int64_t told_after = *rc::gen::inRange(2, 20);  // images
  const HostStamp told{told_after * period + *rc::gen::inRange<std::int64_t>(1, period - 1)};
  bool is_told = false, any = false;
  for (std::int64_t n = 1; n < 40; ++n) {
    const HostStamp stamp{n * period};
    if (!is_told && stamp > told) {
      timeline.change(told, {Span{2'000}, 1});
      is_told = true;
    }
    if (any && *rc::gen::inRange(0, 3) == 0) continue;  // lost
    any = true;
    const auto image = timeline.image(stamp, static_cast<std::uint64_t>(n));
    RC_ASSERT(image.state.time.ns == (n > told_after + delay ? 2'000 : 1'000));
    if (n > told_after + delay + 1) RC_ASSERT(image.is_settled);
    if (n > told_after && n <= told_after + delay) RC_ASSERT(!image.is_settled);
  }
}

TEST(ExposureTimeline, ManyChangesBetweenTwoImagesAreShownInTurn) {
  ExposureTimeline timeline(1);
  timeline.begin({Span{1}, 1});
  timeline.image({1'000}, 1);
  for (std::int64_t i = 0; i < 100; ++i) timeline.change({1'001 + i}, {Span{2 + i}, 1});
  timeline.image({2'000}, 2);
  EXPECT_EQ(timeline.image({3'000}, 3).state.time.ns, 101);
}

TEST(ImageStatistics, AreThoseOfTheImage) {
  // left third black, middle third 100, right third white; rows alike
  constexpr int kWidth = 300, kHeight = 60, kStride = 310;
  std::vector<std::uint8_t> pixels(static_cast<std::size_t>(kStride) * kHeight, 77);
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x)
      pixels[static_cast<std::size_t>(y * kStride + x)] = static_cast<std::uint8_t>(x < 100 ? 0 : x < 200 ? 100 : 255);
  const ImageStatistics s = statistics_of(pixels.data(), kWidth, kHeight, kStride);
  EXPECT_NEAR(s.mean, 355 / 3., 4);
  EXPECT_NEAR(s.dark_share, 1 / 3., 0.02);
  EXPECT_NEAR(s.clipped_share, 1 / 3., 0.02);
  EXPECT_EQ(statistics_of(pixels.data(), 7, 60, kStride).count, 0);
}

}  // namespace
}  // namespace epiline
