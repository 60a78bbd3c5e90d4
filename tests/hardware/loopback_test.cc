// The camera against v4l2loopback: a program writes the images, with stamps of its own.
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "drivers/program/hil/loopback_writer.h"
#include "drivers/sensors/camera/camera_pair.h"
#include "drivers/sensors/camera/side_by_side.h"
#include "tests/hardware/camera_support.h"

namespace epiline {
namespace {

constexpr const char *kDevice = "/dev/video42", *kSecondDevice = "/dev/video43";
constexpr int kWidth = 320, kHeight = 180;
constexpr double kRate_hz = 20;  // what a reader expects of stamps; a loopback says 30 unless told
constexpr std::size_t kBytes = static_cast<std::size_t>(kWidth) * kHeight;

/// Written stamps begin here, years away from this machine's clock. When a device is opened the driver stamps the
/// images that it still holds by that clock, and a reader gets the newest of them: no such stamp may be near a written
/// one.
constexpr std::int64_t kBegin_ns = 1'403'636'579'763'555'000;

/// The other end of the loopback: images of one grey.
class Writer {
 public:
  explicit Writer(const char* device = kDevice) {
    const Status status = writer_.open(device, kWidth, kHeight, kRate_hz);
    EXPECT_TRUE(status) << status.error().text();
  }
  void write(std::uint8_t grey, HostStamp stamp) {
    image_.fill(grey);
    Frame frame;
    frame.stamp = stamp;
    frame.data = image_.data();
    frame.width = frame.stride = kWidth;
    frame.height = kHeight;
    ASSERT_TRUE(writer_.write(frame)) << std::strerror(errno);
  }

 private:
  LoopbackWriter writer_;
  std::array<std::uint8_t, kBytes> image_{};
};

V4l2Settings loopback_settings(const char* device = kDevice) {
  V4l2Settings settings = patient_settings();
  settings.device = device;
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

// A recording's times come through to the microsecond.
TEST_F(Loopback, TheWritersStampsSurvive) {
  Writer writer;
  V4l2Camera camera(loopback_settings());
  ASSERT_OPENS(camera);
  EXPECT_TRUE(camera.copies()) << "the writer would write into lent images";
  for (int i = 1; i <= 20; ++i) {
    const HostStamp stamp{kBegin_ns + i * 50'000'000LL};
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

// It has the time at which the reader asked for buffers.
TEST_F(Loopback, AnImageWrittenBeforeTheStreamIsLeftOut) {
  Writer writer;
  std::int64_t stamp_ns = kBegin_ns;
  for (std::uint8_t grey = 1; grey < 20; grey += 2) {
    writer.write(grey, HostStamp{stamp_ns += 50'000'000});
    V4l2Camera camera(loopback_settings());
    ASSERT_TRUE(camera.open());
    Frame frame;
    if (camera.read(frame, Span::from_milliseconds(20)) == ReadOutcome::kSample) {
      ADD_FAILURE() << "an image with a time of " << frame.stamp.ns << " ns";
      camera.give_back(frame);
    }
    const auto next = static_cast<std::uint8_t>(grey + 1);
    writer.write(next, HostStamp{stamp_ns += 50'000'000});
    ASSERT_TRUE(read_within(camera, frame, kPatience));
    EXPECT_EQ(frame.data[0], next);
    EXPECT_EQ(frame.stamp.ns, stamp_ns);
    camera.give_back(frame);
    EXPECT_EQ(camera.counts().bad_stamps, 0u);
  }
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
  std::uint8_t grey = 99;
  auto feeder =
      std::make_unique<Again>(20, [&](std::int64_t) { writer.write(++grey, HostStamp{now_ns += 50'000'000}); });
  EXPECT_TRUE(read_within(camera, frame, kPatience));
  std::printf("writer back: image after %.0f ms, %llu attempts before\n",
              static_cast<double>(monotonic_ns() - back_ns) * 1e-6,
              static_cast<unsigned long long>(camera.counts().retries));
  feeder.reset();
  EXPECT_GE(frame.data[0], 100);
  camera.give_back(frame);
}

/// Two loopbacks, read as a pair.
class LoopbackPair : public Loopback {
 protected:
  void SetUp() override {
    Loopback::SetUp();
    if (IsSkipped()) return;
    reload("devices=2 video_nr=42,43");
    ASSERT_TRUE(std::filesystem::exists(kSecondDevice));
  }
  void TearDown() override {
    if (!IsSkipped()) reload("video_nr=42");
  }
  static void reload(const std::string& options) {
    ASSERT_EQ(std::system("/sbin/modprobe -r v4l2loopback"), 0);
    ASSERT_EQ(std::system(("/sbin/modprobe v4l2loopback " + options).c_str()), 0);
  }
  /// Both cameras' images of one instant, the second one's first; nothing of the second one without a writer.
  static void write(Writer& first, Writer* second, std::uint8_t grey, std::int64_t stamp_ns) {
    if (second != nullptr) second->write(static_cast<std::uint8_t>(grey + 100), HostStamp{stamp_ns + 200'000});
    first.write(grey, HostStamp{stamp_ns});
  }
};

TEST_F(LoopbackPair, ImagesOfOneInstantComeTogetherAndALostCameraStopsNothing) {
  Writer first(kDevice);
  std::optional<Writer> second(kSecondDevice);
  V4l2Settings of_second = loopback_settings(kSecondDevice);
  of_second.silence_most = Span::from_milliseconds(500);
  auto second_camera = std::make_unique<V4l2Camera>(of_second);
  const V4l2Camera& seen = *second_camera;
  CameraPair pair(std::make_unique<V4l2Camera>(loopback_settings()), std::move(second_camera), {});
  ASSERT_OPENS(pair);
  std::int64_t stamp_ns = kBegin_ns;
  int together = 0, alone = 0;
  const auto round = [&](std::uint8_t grey) {
    write(first, second ? &*second : nullptr, grey, stamp_ns += 50'000'000);
    Frame frame;
    ASSERT_TRUE(read_within(pair, frame, kPatience));
    EXPECT_EQ(frame.data[0], grey);
    const Frame other = pair.others(frame)[0];
    if (other.data != nullptr) {
      EXPECT_EQ(other.data[0], grey + 100);
      EXPECT_EQ((other.stamp - frame.stamp).ns, 200'000);
    }
    (other.data != nullptr ? together : alone) += 1;
    pair.give_back(frame);
  };
  for (int i = 1; i <= 50; ++i) round(static_cast<std::uint8_t>(i));
  EXPECT_GE(together, 45);
  second.reset();
  together = alone = 0;
  for (int i = 1; seen.counts().disconnected == 0 && i < 100'000; ++i) round(static_cast<std::uint8_t>(1 + i % 50));
  EXPECT_GT(seen.counts().disconnected, 0u) << "its silence is noticed";
  EXPECT_EQ(together, 0);
  second.emplace(kSecondDevice);
  together = 0;
  for (int i = 1; together < 10 && i < 100'000; ++i) {
    round(static_cast<std::uint8_t>(1 + i % 50));
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_EQ(together, 10) << "it is read again";
}

TEST_F(LoopbackPair, ADeviceWithBothImagesIsCutInTwo) {
  LoopbackWriter writer;
  ASSERT_TRUE(writer.open(kDevice, 2 * kWidth, kHeight, kRate_hz));
  V4l2Settings settings = loopback_settings();
  settings.width = 2 * kWidth;
  SideBySide camera(std::make_unique<V4l2Camera>(settings), false);
  ASSERT_OPENS(camera);
  std::array<std::uint8_t, kBytes> left{}, right{};
  left.fill(11);
  right.fill(22);
  Frame image;
  image.width = image.stride = kWidth;
  image.height = kHeight;
  image.stamp = HostStamp{1'000'000'000};
  image.data = left.data();
  Frame other = image;
  other.data = right.data();
  ASSERT_TRUE(writer.write(image, other)) << std::strerror(errno);
  Frame first;
  ASSERT_TRUE(read_within(camera, first, kPatience));
  const Frame second = camera.others(first)[0];
  for (const auto& [half, grey] :
       {std::pair<const Frame*, int>(&first, 11), std::pair<const Frame*, int>(&second, 22)}) {
    EXPECT_EQ(half->width, kWidth);
    for (const int x : {0, kWidth - 1})
      for (const int y : {0, kHeight - 1}) EXPECT_EQ(half->data[y * half->stride + x], grey) << x << " " << y;
  }
  camera.give_back(first);
}

}  // namespace
}  // namespace epiline
