// The camera against v4l2loopback: a program writes the images, with stamps of its own.
#include <array>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <thread>

#include "drivers/program/hil/loopback_writer.h"
#include "tests/hardware/camera_support.h"

namespace epiline {
namespace {

constexpr const char* kDevice = "/dev/video42";
constexpr int kWidth = 320, kHeight = 180;
constexpr std::size_t kBytes = static_cast<std::size_t>(kWidth) * kHeight;

/// The other end of the loopback: images of one grey.
class Writer {
 public:
  Writer() {
    const Status status = writer_.open(kDevice, kWidth, kHeight);
    EXPECT_TRUE(status) << status.error().text();
  }
  void write(std::uint8_t grey, HostStamp stamp, std::size_t bytes = kBytes) {
    image_.fill(grey);
    Frame frame;
    frame.stamp = stamp;
    frame.data = image_.data();
    frame.width = frame.stride = kWidth;
    frame.height = kHeight;
    ASSERT_TRUE(writer_.write(frame, bytes)) << std::strerror(errno);
  }

 private:
  LoopbackWriter writer_;
  std::array<std::uint8_t, kBytes> image_{};
};

V4l2Settings loopback_settings() {
  V4l2Settings settings = patient_settings();
  settings.device = kDevice;
  settings.width = kWidth;
  settings.height = kHeight;
  settings.formats = {PixelFormat::kGrey};
  settings.trust_stamps = true;
  settings.stamp_point = StampPoint::kStartOfExposure;
  return settings;
}

class Loopback : public testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(kDevice)) GTEST_SKIP() << "v4l2loopback is not loaded; expected ./run hardware";
  }
};

// A recording's times, years away from this machine's clock: they come through to the microsecond.
TEST_F(Loopback, TheWritersStampsSurvive) {
  Writer writer;
  V4l2Camera camera(loopback_settings());
  const Status status = camera.open();
  ASSERT_TRUE(status) << status.error().text();
  EXPECT_TRUE(camera.copies()) << "the writer would write into lent images";
  for (int i = 1; i <= 20; ++i) {
    const HostStamp stamp{1'403'636'579'763'555'000 + i * 50'000'000LL};
    writer.write(static_cast<std::uint8_t>(i), stamp);
    Frame frame;
    ASSERT_TRUE(read_within(camera, frame, kPatience));
    EXPECT_EQ(frame.stamp, stamp);
    EXPECT_EQ(frame.data[0], i);
    EXPECT_EQ(frame.data[(kHeight - 1) * frame.stride + kWidth - 1], i);
    EXPECT_EQ(frame.sequence, static_cast<std::uint64_t>(i - 1)) << "a driver that does not count: each image is one";
    camera.give_back(frame);
  }
  EXPECT_EQ(camera.counts().lost, 0u);
}

TEST_F(Loopback, StampsNobodyVouchesForAreAnError) {
  Writer writer;
  V4l2Settings settings = loopback_settings();
  settings.trust_stamps = false;
  V4l2Camera camera(settings);
  const Status status = camera.open();
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().text(),
            std::string(kDevice) +
                ": its driver does not declare monotonic timestamps; expected monotonic timestamps; "
                "camera.trust_stamps = true if they are");
}

TEST_F(Loopback, ShortImagesAndStampsThatStandStillOrJumpAreLeftOut) {
  Writer writer;
  V4l2Camera camera(loopback_settings());
  ASSERT_TRUE(camera.open());
  const auto expect_image = [&](std::uint8_t grey) {
    Frame frame;
    ASSERT_TRUE(read_within(camera, frame, kPatience));
    EXPECT_EQ(frame.data[0], grey);
    camera.give_back(frame);
  };
  const auto expect_none = [&] {
    Frame frame;
    EXPECT_EQ(camera.read(frame, Span::from_milliseconds(50)), ReadOutcome::kTimeout);
  };
  writer.write(1, HostStamp{1'000'000'000});
  expect_image(1);
  writer.write(2, HostStamp{1'010'000'000}, kBytes - 1);
  expect_none();
  writer.write(3, HostStamp{1'000'000'000});
  expect_none();
  EXPECT_EQ(camera.counts().bad_stamps, 1u);
  writer.write(4, HostStamp{1'020'000'000});
  expect_image(4);
  writer.write(5, HostStamp{1'000'000'000'000});  // a quarter of an hour ahead
  expect_none();
  writer.write(6, HostStamp{1'030'000'000});
  expect_image(6);
  EXPECT_EQ(camera.counts().incomplete, 1u);
  EXPECT_EQ(camera.counts().bad_stamps, 2u);
}

// The closest a loopback comes to being unplugged: its writer ends, the driver goes and comes back.
TEST_F(Loopback, AWriterThatComesBackIsReadAgain) {
  V4l2Settings settings = loopback_settings();
  settings.silence_most = Span::from_milliseconds(3'000);
  V4l2Camera camera(settings);
  std::int64_t now_ns = 1'000'000'000;
  Frame frame;
  {
    Writer writer;
    ASSERT_TRUE(camera.open());
    writer.write(1, HostStamp{now_ns});
    ASSERT_TRUE(read_within(camera, frame, kPatience));
    camera.give_back(frame);
  }
  ASSERT_TRUE(read_until(camera, [&] { return camera.counts().disconnected > 0; })) << "silence is noticed";
  ASSERT_EQ(std::system("/sbin/modprobe -r v4l2loopback"), 0);
  ASSERT_FALSE(std::filesystem::exists(kDevice));
  for (int i = 0; i < 10; ++i) EXPECT_EQ(camera.read(frame, Span::from_milliseconds(100)), ReadOutcome::kFailed);
  ASSERT_EQ(std::system("/sbin/modprobe v4l2loopback video_nr=42"), 0);
  Writer writer;
  const std::int64_t back_ns = monotonic_ns();
  std::atomic<bool> done{false};
  std::thread feeder([&] {
    for (std::uint8_t grey = 100; !done; ++grey) {
      writer.write(grey, HostStamp{now_ns += 50'000'000});
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
  });
  EXPECT_TRUE(read_within(camera, frame, kPatience));
  std::printf("writer back: image after %.0f ms, %llu attempts before\n",
              static_cast<double>(monotonic_ns() - back_ns) * 1e-6,
              static_cast<unsigned long long>(camera.counts().retries));
  done = true;
  feeder.join();
  EXPECT_GE(frame.data[0], 100);
  camera.give_back(frame);
}

}  // namespace
}  // namespace epiline
