#include "drivers/sensors/camera/side_by_side.h"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <memory>

namespace epiline {
namespace {

/// Four pixels a row, numbered.
class WideCamera final : public CameraSource {
 public:
  Status open() override { return Done{}; }
  void close() noexcept override {}
  ReadOutcome read(Frame& frame, Span /*timeout*/) noexcept override {
    frame = {};
    frame.data = pixels_.data();
    frame.width = 4;
    frame.height = 2;
    frame.stride = 5;
    frame.stamp = HostStamp{17};
    frame.slot = 3;
    return ReadOutcome::kSample;
  }
  void give_back(const Frame& frame) noexcept override { given_back = frame.slot; }
  int given_back = -1;

 private:
  std::array<std::uint8_t, 10> pixels_{0, 1, 2, 3, 99, 4, 5, 6, 7, 99};
};

TEST(SideBySide, HalvesAreTwoImages) {
  for (const bool right_is_first : {false, true}) {
    auto wide = std::make_unique<WideCamera>();
    const WideCamera* const both = wide.get();
    SideBySide camera(std::move(wide), right_is_first);
    Frame first;
    ASSERT_EQ(camera.read(first, {}), ReadOutcome::kSample);
    const Frame second = camera.others(first)[0];
    const Frame& left = right_is_first ? second : first;
    const Frame& right = right_is_first ? first : second;
    for (const Frame* half : {&left, &right}) {
      EXPECT_EQ(half->width, 2);
      EXPECT_EQ(half->height, 2);
      EXPECT_EQ(half->stride, 5);
      EXPECT_EQ(half->stamp.ns, 17);
    }
    EXPECT_EQ(left.data[0], 0);
    EXPECT_EQ(left.data[6], 5);
    EXPECT_EQ(right.data[0], 2);
    EXPECT_EQ(right.data[6], 7);
    camera.give_back(first);
    EXPECT_EQ(both->given_back, 3);
  }
}

}  // namespace
}  // namespace epiline
