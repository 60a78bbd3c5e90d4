// A USB camera behind the kernel's own driver uvcvideo: the driver's stamps, and those of the camera's own clock.
#include <algorithm>
#include <cstdio>
#include <memory>

#include "tests/hardware/camera_support.h"
#include "tests/hardware/uvc_gadget.h"

namespace epiline {
namespace {

class UvcOfTheKernel : public testing::Test {
 protected:
  void SetUp() override {
    if (!UvcGadget::can_be_had())
      GTEST_SKIP() << "the drivers dummy_hcd, gadgetfs and uvcvideo are not loaded; expected ./run hardware";
    plug_in();
  }
  void plug_in() {
    gadget_ = std::make_unique<UvcGadget>();
    ASSERT_TRUE(within(120, [] { return !UvcGadget::node().empty(); })) << "the camera did not come";
  }
  static V4l2Settings settings() {
    V4l2Settings settings = patient_settings();
    settings.device = "UVC Camera (1209:0002)";
    settings.width = UvcGadget::kWidth;
    settings.height = UvcGadget::kHeight;
    settings.formats = {PixelFormat::kGrey};
    return settings;
  }
  /// Least and largest of how late the stamps of images are.
  struct Lateness {
    double least_ms = 1e9, most_ms = -1e9;
    void add(Span late) {
      least_ms = std::min(least_ms, late.seconds() * 1e3);
      most_ms = std::max(most_ms, late.seconds() * 1e3);
    }
    double spread_ms() const { return most_ms - least_ms; }
  };
  Lateness lateness(V4l2Camera& camera, int images) {
    Lateness late;
    watch(camera, images, [&](const Frame& frame) { late.add(frame.stamp - gadget_->taken(frame.data)); });
    std::printf("stamps are %.2f to %.2f ms late\n", late.least_ms, late.most_ms);
    return late;
  }

  std::unique_ptr<UvcGadget> gadget_;
};

TEST_F(UvcOfTheKernel, TheDriversStampIsThatOfTheFirstPacket) {
  V4l2Camera camera(settings());
  ASSERT_OPENS(camera);
  watch(camera, 20, [&](const Frame& frame) {
    EXPECT_GE(frame.stamp, gadget_->left(frame.data));
    EXPECT_LE(frame.stamp.ns, monotonic_ns());
    EXPECT_EQ(frame.data[UvcGadget::kWidth], 100);
  });
  // images leave 10 to 40 ms after they were taken, by turns
  EXPECT_GT(lateness(camera, 12).spread_ms(), 25);
}

TEST_F(UvcOfTheKernel, TheCamerasClockTellsWhenImagesWereTaken) {
  V4l2Settings s = settings();
  s.uses_own_clock = true;
  V4l2Camera camera(s);
  ASSERT_OPENS(camera);
  watch(camera, 20, [](const Frame&) {});
  const std::uint64_t without = camera.counts().without_clock;
  const Lateness late = lateness(camera, 40);
  EXPECT_LT(late.spread_ms(), 5);
  EXPECT_GT(late.least_ms, -1) << "before it was taken";
  EXPECT_LT(late.most_ms, 10) << "the earliest image leaves 10 ms after it was taken";
  EXPECT_EQ(camera.counts().without_clock, without);
  EXPECT_EQ(camera.counts().bad_metadata, 0u);
}

TEST_F(UvcOfTheKernel, APluggedInCameraGoesOnByItsClock) {
  V4l2Settings s = settings();
  s.uses_own_clock = true;
  V4l2Camera camera(s);
  ASSERT_OPENS(camera);
  watch(camera, 5, [](const Frame&) {});
  gadget_.reset();
  ASSERT_TRUE(read_until(camera, [&] { return camera.counts().disconnected > 0 && camera.counts().retries > 0; }));
  plug_in();
  ASSERT_TRUE(read_until(camera, [&] { return camera.is_streaming(); }));
  watch(camera, 20, [](const Frame&) {});
  EXPECT_LT(lateness(camera, 20).spread_ms(), 5);
}

}  // namespace
}  // namespace epiline
