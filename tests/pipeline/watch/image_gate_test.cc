#include "pipeline/watch/image_gate.h"
#include "tests/support/times.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

namespace epiline {
namespace {

constexpr int kWidth = 320, kHeight = 240;
/// A camera that sees a random texture through noise.
class Camera {
 public:
  Camera() : texture_(kWidth * kHeight), pixels_(kWidth * kHeight) {
    for (auto& t : texture_) t = static_cast<std::uint8_t>(60 + random_() % 120);
  }
  std::vector<std::uint8_t>& expose() {
    for (std::size_t i = 0; i < pixels_.size(); ++i)
      pixels_[i] = static_cast<std::uint8_t>(texture_[i] + random_() % 5);
    return pixels_;
  }
  std::vector<std::uint8_t>& pixels() { return pixels_; }
  Frame frame() {
    Frame f;
    f.stamp = f.arrival = HostStamp{kStart_ns + 50'000'000LL * count_++};
    f.data = pixels_.data();
    f.width = f.stride = kWidth;
    f.height = kHeight;
    return f;
  }

 private:
  std::mt19937 random_{11};
  std::vector<std::uint8_t> texture_, pixels_;
  int count_ = 0;
};

std::uint32_t says(ImageGate& gate, Frame frame) { return gate.step(frame) ? frame.reasons : ~0U; }

class ImageGateTest : public testing::Test {
 protected:
  void SetUp() override {
    for (int i = 0; i < 30; ++i) {
      camera.expose();
      ASSERT_EQ(says(gate, camera.frame()), 0U);
    }
  }
  Camera camera;
  ImageGate gate;
};

TEST_F(ImageGateTest, CopiesAreLeftOutUntilTheCameraIsFrozen) {
  for (int i = 0; i < 3; ++i) ASSERT_EQ(says(gate, camera.frame()), ~0U);
  for (int i = 0; i < 5; ++i) ASSERT_EQ(says(gate, camera.frame()), bit(HealthReason::kImagesFrozen));
  camera.expose();
  EXPECT_EQ(says(gate, camera.frame()), 0U);
  EXPECT_EQ(gate.stats().copies, 3U);
  EXPECT_EQ(gate.stats().frozen, 5U);
}

/// A driver at 60 Hz, a sensor at 20 Hz: two copies of each image.
TEST_F(ImageGateTest, OfADriverThatRepeatsEachImageTheFirstIsUsed) {
  for (int i = 0; i < 60; ++i) {
    if (i % 3 == 0) camera.expose();
    ASSERT_EQ(says(gate, camera.frame()), i % 3 == 0 ? 0U : ~0U) << i;
  }
  EXPECT_EQ(gate.stats().frozen, 0U);
}

TEST_F(ImageGateTest, WithoutContrastTheLensIsCovered) {
  for (const int grey : {0, 128, 255}) {
    for (int i = 0; i < 3; ++i) {
      auto& pixels = camera.expose();
      std::fill(pixels.begin(), pixels.end(), static_cast<std::uint8_t>(grey));
      ASSERT_EQ(says(gate, camera.frame()), bit(HealthReason::kLensCovered)) << grey;
    }
    camera.expose();
    ASSERT_EQ(says(gate, camera.frame()), 0U) << "no step of the exposure either";
  }
}

// Of 8 x 6 cells: one with contrast may be a dark sensor's hot pixels, four are a view past something.
TEST_F(ImageGateTest, ACoveredLensMayShowContrastInOneCellNotInFour) {
  const auto show = [&](int cells) {
    auto& pixels = camera.expose();
    for (int y = 0; y < kHeight; ++y)
      for (int x = 0; x < kWidth; ++x)
        if (y >= kHeight / 6 || x >= cells * kWidth / 8) pixels[static_cast<std::size_t>(y * kWidth + x)] = 100;
    return says(gate, camera.frame());
  };
  EXPECT_EQ(show(1), bit(HealthReason::kLensCovered));
  EXPECT_EQ(show(4) & (bit(HealthReason::kLensCovered) | bit(HealthReason::kViewObstructed)),
            bit(HealthReason::kViewObstructed));
}

TEST_F(ImageGateTest, HalfOfThePictureGoneIsObstructedUntilItIsUsual) {
  int said = 0;
  for (int i = 0; i < 400; ++i) {
    auto& pixels = camera.expose();
    for (int y = 0; y < kHeight; ++y)
      std::fill_n(pixels.begin() + std::ptrdiff_t{y} * kWidth, kWidth / 2, std::uint8_t{100});
    said += says(gate, camera.frame()) == bit(HealthReason::kViewObstructed) ? 1 : 0;
  }
  EXPECT_GT(said, 60);
  EXPECT_LT(said, 300);
}

TEST(ImageGate, WhicheverHalfOfThePictureIsGoneIsSeen) {
  using Gone = bool (*)(int x, int y);
  const Gone halves[] = {[](int x, int) { return x < kWidth / 2; }, [](int x, int) { return x >= kWidth / 2; },
                         [](int, int y) { return y < kHeight / 2; }, [](int, int y) { return y >= kHeight / 2; }};
  for (const Gone gone : halves) {
    Camera camera;
    ImageGate gate;
    for (int i = 0; i < 30; ++i) {
      camera.expose();
      ASSERT_EQ(says(gate, camera.frame()), 0U);
    }
    auto& pixels = camera.expose();
    for (int y = 0; y < kHeight; ++y)
      for (int x = 0; x < kWidth; ++x)
        if (gone(x, y)) pixels[static_cast<std::size_t>(y * kWidth + x)] = 100;
    EXPECT_EQ(says(gate, camera.frame()), bit(HealthReason::kViewObstructed));
  }
}

TEST_F(ImageGateTest, BrightnessThatStepsIsToldOnce) {
  int said = 0;
  for (int i = 0; i < 20; ++i) {
    for (auto& p : camera.expose()) p = static_cast<std::uint8_t>(p / 2);
    said += says(gate, camera.frame()) == bit(HealthReason::kExposureStep) ? 1 : 0;
  }
  EXPECT_EQ(said, 1);
}

TEST_F(ImageGateTest, StampsThatStepAreTakenBackAndNamed) {
  for (int i = 0; i < 200; ++i) {
    camera.expose();
    Frame f = camera.frame();
    const HostStamp truth = f.stamp;
    f.stamp = f.stamp + Span::from_milliseconds(500);
    const bool used = gate.step(f);
    ASSERT_EQ(used, i > 0);
    if (!used) continue;
    ASSERT_EQ(f.stamp, truth);
    ASSERT_EQ(f.reasons, i < 101 ? bit(HealthReason::kCameraClockJump) : 0U) << i << ": over after 5 s";
  }
}

TEST(ImageGate, WithoutPixelsOnlyStampsAreJudged) {
  ImageGate gate;
  for (int i = 0; i < 50; ++i) {
    Frame f;
    f.stamp = HostStamp{kStart_ns + i};
    ASSERT_EQ(says(gate, f), 0U);
  }
}

}  // namespace
}  // namespace epiline
