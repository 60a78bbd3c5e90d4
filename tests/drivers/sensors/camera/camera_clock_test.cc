// A USB camera with a clock of its own, against a made-up kernel: its driver stamps late and unevenly.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "drivers/sensors/camera/metadata_node.h"
#include "drivers/sensors/camera/uvc_clock.h"
#include "tests/drivers/fake_graph.h"
#include "tests/drivers/fake_metadata.h"
#include "tests/drivers/sensors/camera/camera_rig.h"

namespace epiline {
namespace {

using test::CameraRig;
using test::FakeCamera;
using test::FakeMetadata;
using test::kMs;
using test::kSecond_ns;
using Bytes = std::vector<std::uint8_t>;

Bytes joined(std::initializer_list<Bytes> parts) {
  Bytes all;
  for (const Bytes& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

// ---- bytes ----

TEST(UvcMetadata, HeadersAreTakenOneByOne) {
  const Bytes bytes = joined({test::uvc_header(5'000, 0x11223344, 0xffeeddcc), test::uvc_header(6'000, 1, 2)});
  std::span<const std::uint8_t> left = bytes;
  UvcHeader header;
  ASSERT_TRUE(take_header(left, header));
  EXPECT_EQ(header.arrival.ns, 5'000);
  EXPECT_TRUE(header.has_image_time && header.has_clock);
  EXPECT_EQ(header.image_time, 0x11223344u);
  EXPECT_EQ(header.clock, 0xffeeddccu);
  ASSERT_TRUE(take_header(left, header));
  EXPECT_EQ(header.clock, 2u);
  EXPECT_TRUE(left.empty());
  EXPECT_FALSE(take_header(left, header));
}

TEST(UvcMetadata, NothingIsReadOfWhatIsNotThere) {
  const Bytes whole = test::uvc_header(5'000, 7, 9);
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const Bytes cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
    std::span<const std::uint8_t> left = cut;
    UvcHeader header;
    EXPECT_FALSE(take_header(left, header)) << size;
    EXPECT_TRUE(left.empty());
  }
  // its length says less than its flags
  for (const int length : {2, 6, 11}) {
    Bytes shorter(whole.begin(), whole.begin() + 10 + length);
    shorter[10] = static_cast<std::uint8_t>(length);
    std::span<const std::uint8_t> left = shorter;
    UvcHeader header;
    ASSERT_TRUE(take_header(left, header));
    EXPECT_EQ(header.has_image_time, length >= 6);
    EXPECT_FALSE(header.has_clock);
  }
}

/// Configuration, interface of video control with its header, interface of streaming with a header of its own.
const Bytes kDescriptors = {9,  2,    60, 0,    2,  1,  0,    0x80, 50,                      //
                            9,  4,    2,  0,    0,  14, 1,    0,    0,                       //
                            13, 0x24, 1,  0x10, 1,  40, 0,    0x00, 0x6c, 0xdc, 0x02, 1, 3,  // 48 MHz
                            9,  4,    3,  0,    0,  14, 2,    0,    0,                       //
                            14, 0x24, 1,  1,    77, 0,  0x81, 9,    9,    9,    9,    9, 9, 9};

TEST(UvcMetadata, TheClocksRateIsInTheDescriptors) {
  EXPECT_EQ(clock_hz_of(kDescriptors, 2), 48'000'000u);
  EXPECT_EQ(clock_hz_of(kDescriptors, 0), 0u) << "another camera's";
  EXPECT_EQ(clock_hz_of(kDescriptors, 3), 0u) << "the header of the stream is another";
  for (std::size_t size = 0; size < 31; ++size) EXPECT_EQ(clock_hz_of(std::span(kDescriptors).first(size), 2), 0u);
}

// ---- a camera ----

struct ClockRig : CameraRig {
  static constexpr double kHz = 48e6, kSkew = 40e-6;

  ClockRig() {
    settings.uses_own_clock = true;
    settings.clock_hz = static_cast<std::uint32_t>(kHz);
    kernel.devices["/dev/video1"] = node;
    device->change_image = [this](FakeCamera::Image& image) {
      // taken at this instant; the driver's stamp is that of the first packet
      const std::int64_t taken_ns = image.stamp_ns - 14 * kMs;
      const std::int64_t first_ns = image.stamp_ns - delay(8 * kMs);
      taken.push_back(taken_ns);
      Bytes bytes;
      for (int packet = 0; packet < 4; ++packet) {
        const std::int64_t sent_ns = first_ns - 4 * kMs + packet * 100'000;
        const Bytes one = test::uvc_header(sent_ns + 50'000 + delay(2 * kMs), ticks(taken_ns), ticks(sent_ns));
        bytes.insert(bytes.end(), one.begin(), one.end());
      }
      if (change_metadata) change_metadata(image.sequence, bytes);
      node->give(image.sequence, bytes);
      image.stamp_ns = first_ns;
    };
  }
  std::int64_t delay(std::int64_t most_ns) { return std::uniform_int_distribution<std::int64_t>(0, most_ns)(random); }
  static std::uint32_t ticks(std::int64_t ns) {
    return static_cast<std::uint32_t>(static_cast<std::int64_t>(static_cast<double>(ns) * 1e-9 * kHz * (1 + kSkew)));
  }
  /// Largest distance from the instant that an image was taken at, and largest step of it, ms.
  struct Errors {
    double most_ms = 0, step_ms = 0;
    std::size_t images = 0;
  };
  Errors watch(double seconds) {
    Errors errors;
    double before = 0;
    errors.images = run(seconds, [&](const Frame& frame) {
      const auto nearest = std::min_element(taken.begin(), taken.end(), [&](std::int64_t a, std::int64_t b) {
        return std::abs(a - frame.stamp.ns) < std::abs(b - frame.stamp.ns);
      });
      const double ms = 1e-6 * static_cast<double>(frame.stamp.ns - *nearest);
      errors.most_ms = std::max(errors.most_ms, std::abs(ms));
      if (errors.images++ > 0) errors.step_ms = std::max(errors.step_ms, std::abs(ms - before));
      before = ms;
    });
    return errors;
  }

  std::shared_ptr<FakeMetadata> node = std::make_shared<FakeMetadata>(*device);
  std::function<void(std::uint32_t sequence, Bytes&)> change_metadata;
  std::vector<std::int64_t> taken;
  std::mt19937 random{5};
};

TEST(CameraClock, ImagesGetTheTimeTheCameraTookThemAt) {
  ClockRig rig;
  rig.open();
  rig.watch(10);
  const ClockRig::Errors errors = rig.watch(100);  // the counter turns over once
  EXPECT_NEAR(static_cast<double>(errors.images), 3000, 2);
  EXPECT_LT(errors.most_ms, 0.3) << "the driver's stamps scatter by 8 ms";
  EXPECT_EQ(rig.camera->clock_state().status, ClockStatus::kLocked);
  EXPECT_NEAR(rig.camera->clock_state().skew_ppm, -40, 3);
  const CameraCounts counts = rig.camera->counts();
  EXPECT_EQ(counts.without_clock + counts.bad_metadata + counts.bad_stamps + counts.lost, 0u);
}

TEST(CameraClock, WithoutItTheDriversStampsHold) {
  ClockRig rig;
  rig.settings.uses_own_clock = false;
  rig.open();
  EXPECT_GT(rig.watch(10).most_ms, 8);
  EXPECT_EQ(rig.node->given, 0u);
  EXPECT_FALSE(rig.camera->has_own_clock());
}

TEST(CameraClock, BrokenMetadataCostNoImage) {
  ClockRig rig;
  rig.open();
  rig.watch(10);
  rig.change_metadata = [](std::uint32_t sequence, Bytes& bytes) {
    if (sequence % 8 == 1) bytes.clear();                                        // none
    if (sequence % 8 == 3) bytes.resize(bytes.size() - 5);                       // cut short
    if (sequence % 8 == 5) bytes.assign(200, 0xff);                              // of something else
    if (sequence % 8 == 7) std::fill_n(bytes.begin() + 12, 4, std::uint8_t{0});  // an image of long ago
  };
  const ClockRig::Errors errors = rig.watch(16);
  EXPECT_NEAR(static_cast<double>(errors.images), 480, 2) << "each is stamped";
  EXPECT_LT(errors.most_ms, 9) << "by the driver's stamp less its usual lag, where it must be";
  const CameraCounts counts = rig.camera->counts();
  EXPECT_NEAR(static_cast<double>(counts.without_clock), 120, 4) << "nothing, and something else";
  EXPECT_NEAR(static_cast<double>(counts.bad_metadata), 180, 4);
  EXPECT_EQ(rig.camera->clock_state().status, ClockStatus::kLocked);
}

TEST(CameraClock, AWrongRateOfTheClockIsSeenAndNotFollowed) {
  ClockRig rig;
  rig.settings.clock_hz = 30'000'000;
  rig.open();
  rig.watch(10);
  EXPECT_LT(rig.watch(20).most_ms, 25) << "the driver's";
  EXPECT_EQ(rig.camera->clock_state().status, ClockStatus::kUnusable);
  EXPECT_GT(rig.camera->counts().without_clock, 590u);
}

TEST(CameraClock, ALostCameraComesBackWithItsClock) {
  ClockRig rig;
  rig.open();
  rig.watch(10);
  const int mappings = rig.kernel.mappings;
  const std::size_t files = rig.kernel.open_files();
  rig.device->dequeue_error = EIO;
  rig.watch(10);
  EXPECT_LT(rig.watch(10).most_ms, 0.4);
  EXPECT_EQ(rig.camera->counts().disconnected, 1u);
  EXPECT_EQ(rig.kernel.mappings, mappings);
  EXPECT_EQ(rig.kernel.open_files(), files);
}

TEST(CameraClock, SaysWhatTheCameraLacks) {
  ClockRig rig;
  rig.settings.clock_hz = 0;
  EXPECT_EQ(rig.error(),
            "/dev/video0: the camera does not tell how fast its clock runs [camera.clock_hz]; expected the ticks per "
            "second, or camera.clock = \"driver\"");
  rig.kernel.devices["/sys/dev/char/81:0/device/bInterfaceNumber"] = std::make_shared<test::FakeText>("02\n");
  rig.kernel.devices["/sys/dev/char/81:0/device/../descriptors"] =
      std::make_shared<test::FakeText>(std::string(kDescriptors.begin(), kDescriptors.end()));
  rig.open();
  rig.watch(10);
  EXPECT_LT(rig.watch(10).most_ms, 0.4) << "told by the descriptors";
  rig.camera.reset();
  rig.node->format = V4L2_META_FMT_D4XX;
  EXPECT_EQ(rig.error(),
            "/dev/video0: the camera's metadata are not those of USB video [VIDIOC_S_FMT of metadata]; expected "
            "camera.clock = \"driver\"");
  rig.kernel.devices.erase("/dev/video1");
  EXPECT_EQ(rig.error(),
            "/dev/video0: the camera has no node of metadata, so its own clock is not known [camera.clock]; expected "
            "camera.clock = \"driver\"");
}

}  // namespace
}  // namespace epiline
