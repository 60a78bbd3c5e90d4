// Every image that a camera lends comes back once, whole until then, and the camera never starves. The camera is made
// up: it has a few buffers, and a buffer that comes back is overwritten at once. Run under the thread sanitizer too.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <memory>
#include <vector>

#include "pipeline/realtime/realtime_pipeline.h"
#include "tests/pipeline/realtime/resting_imu.h"

namespace epiline {
namespace {

using test::nap;
using test::reading_stamp;

constexpr int kImageEach = 10, kImages = 200, kReadings = kImages * kImageEach + 2;
constexpr int kWidth = 160, kHeight = 120;

using Pixels = std::array<std::uint8_t, static_cast<std::size_t>(kWidth* kHeight)>;

/// Blocks of many greys, which have corners, and a little that is another in each image. One in nine is dark: the
/// tracker is not shown it.
void draw(std::uint64_t sequence, Pixels& pixels) {
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const std::size_t block = i / kWidth / 8 * 31 + i % kWidth / 8;
    const std::uint64_t grey = block * 2654435761U % 200 + (i * 7 + sequence * 13) % 5;
    pixels[i] = static_cast<std::uint8_t>(sequence % 9 == 8 ? sequence % 3 : grey);
  }
}

/// Gives images as fast as buffers come back. In a pause it first waits for all but the one that the tracker keeps.
class LendingCamera final : public CameraSource {
 public:
  explicit LendingCamera(std::size_t buffers) : buffers_(buffers) {}
  Status open() override { return Done{}; }
  void close() noexcept override {}
  ReadOutcome read(Frame& frame, Span timeout) noexcept override {
    if (given == kImages || starved) {
      over = true;
      return ReadOutcome::kEnd;
    }
    const std::size_t most_lent = given % pause_every == 0 ? 1 : buffers_.size() - 1;
    const std::int64_t began_ns = monotonic_ns();
    while (lent() > most_lent || given >= hold_at) {
      if (monotonic_ns() - began_ns > timeout.ns) return tell_of_nothing(began_ns);
      nap();
    }
    waiting_since_ns_ = 0;
    const auto slot =
        static_cast<std::size_t>(std::find_if(buffers_.begin(), buffers_.end(),
                                              [](const Buffer& b) { return !b.lent.load(std::memory_order_acquire); }) -
                                 buffers_.begin());
    Buffer& buffer = buffers_[slot];
    frame = {reading_stamp(kImageEach * given),
             static_cast<std::uint64_t>(given),
             buffer.pixels.data(),
             kWidth,
             kHeight,
             kWidth,
             static_cast<int>(slot)};
    draw(frame.sequence, buffer.pixels);
    buffer.lent.store(true, std::memory_order_relaxed);
    ++given;
    return ReadOutcome::kSample;
  }
  void give_back(const Frame& frame) noexcept override {
    Buffer& buffer = buffers_[static_cast<std::size_t>(frame.slot)];
    buffer.pixels.fill(0xff);
    if (!buffer.lent.exchange(false, std::memory_order_release)) ++returned_twice;
    ++returned;
  }
  std::size_t lent() const {
    return static_cast<std::size_t>(std::count_if(
        buffers_.begin(), buffers_.end(), [](const Buffer& b) { return b.lent.load(std::memory_order_acquire); }));
  }

  std::atomic<int> given{0}, returned{0}, returned_twice{0}, hold_at{kImages};
  std::atomic<bool> starved{false}, over{false};  ///< over: the last image was handed on
  int pause_every = 1 << 30;

 private:
  struct Buffer {
    Pixels pixels{};
    std::atomic<bool> lent{false};
  };

  ReadOutcome tell_of_nothing(std::int64_t began_ns) {
    constexpr std::int64_t kNever_ns = 60'000'000'000;
    if (waiting_since_ns_ == 0) waiting_since_ns_ = began_ns;
    if (given >= hold_at || monotonic_ns() - waiting_since_ns_ < kNever_ns) return ReadOutcome::kTimeout;
    starved = true;
    return ReadOutcome::kEnd;
  }

  std::vector<Buffer> buffers_;
  std::int64_t waiting_since_ns_ = 0;
};

/// Looks at the pixels of every image it gets, for as long as it is made to.
class Onlooker final : public FlightObserver {
 public:
  void take(const FrameOutcome& outcome) noexcept override { newest = outcome.stamp; }
  bool wants_images() const noexcept override { return true; }
  void image(const Frame& frame, const OtherFrames& /*others*/) noexcept override {
    ++images;
    do {
      draw(frame.sequence, expected_);
      if (!std::equal(expected_.begin(), expected_.end(), frame.data)) ++spoilt;
      if (held) nap();
    } while (held);
  }

  std::atomic<bool> held{false};
  std::atomic<int> images{0}, spoilt{0};
  HostStamp newest;  ///< of the images estimated

 private:
  Pixels expected_{};
};

/// A flight with so many buffers, of which observers may hold as many as a live flight leaves them.
struct Flight {
  explicit Flight(std::size_t buffers) : camera(buffers) {
    settings.camera = {CameraModel::kPinholeRadialTangential, kWidth, kHeight, {100, 100, 80, 60}, {}};
    settings.images_to_log = std::clamp(static_cast<int>(buffers) - 4, 0, 4);
    settings.realtime.imu_wait_ms = 3.6e6;  // longer than any machine is busy
    settings.realtime.lock_memory = false;
    settings.realtime.priority = 0;
  }
  void start() {
    pipeline = std::make_unique<RealtimePipeline>(settings, RealtimePorts{&camera, &imu, nullptr, {&onlooker}, {}});
    pipeline->arm({test::kFirstReading, monotonic_ns(), 1});
  }
  template <class What>
  void wait_until(What&& what) {
    while (!what() && !pipeline->finished()) nap();
  }
  RealtimeReport land() {
    wait_until([] { return false; });
    pipeline->join();
    return pipeline->report();
  }
  void expect_all_back() {
    EXPECT_EQ(camera.lent(), 0u);
    EXPECT_EQ(camera.returned, camera.given);
    EXPECT_EQ(camera.returned_twice, 0);
    EXPECT_EQ(onlooker.spoilt, 0) << "an image was overwritten while the log had it";
    EXPECT_FALSE(camera.starved);
  }

  RealtimeSettings settings;
  test::RestingImu imu{kReadings};
  LendingCamera camera;
  Onlooker onlooker;
  std::unique_ptr<RealtimePipeline> pipeline;
};

class LentImages : public testing::TestWithParam<std::size_t> {};

// From the fewest buffers that a camera may have to as many as let the ring before the tracker overflow.
INSTANTIATE_TEST_SUITE_P(Buffers, LentImages, testing::Values(2, 3, 4, 5, 6, 8, 16));

TEST_P(LentImages, TheCameraNeverStarves) {
  Flight flight(GetParam());
  flight.camera.pause_every = 10;
  flight.start();
  const RealtimeReport report = flight.land();
  flight.expect_all_back();
  EXPECT_EQ(flight.camera.given, kImages);
  EXPECT_EQ(report.frames_out + report.frames_overtaken, report.frames_in);
  EXPECT_GE(report.frames_out, static_cast<std::uint64_t>(kImages) / 10) << "at least one from each pause to the next";
}

TEST_P(LentImages, ComeBackFromAFlightStoppedInTheMiddle) {
  Flight flight(GetParam());
  flight.camera.hold_at = kImages / 2;
  flight.start();
  flight.wait_until([&] { return flight.camera.given >= kImages / 4; });
  flight.pipeline->stop();
  flight.pipeline->join();
  flight.expect_all_back();
  EXPECT_LT(flight.camera.given, kImages);
}

// The tracker waits for readings with one image in hand; four wait for it, the others leave for newer ones. Which one
// it has in hand is up to the machine: the first, a later one, or none if the tracker had no processor all the time.
TEST(LentImages, OvertakenOnesComeBack) {
  Flight flight(6);
  flight.imu.hold_at = 0;
  flight.start();
  flight.wait_until([&] { return flight.camera.over.load(); });
  EXPECT_GE(flight.camera.returned, kImages - 5);
  flight.imu.hold_at = test::RestingImu::kNever;
  const RealtimeReport report = flight.land();
  flight.expect_all_back();
  EXPECT_GE(report.frames_out, 1u);
  EXPECT_LE(report.frames_out, 5u);
  EXPECT_EQ(flight.onlooker.newest, reading_stamp(kImageEach * (kImages - 1)));
  EXPECT_EQ(report.frames_out + report.frames_overtaken, static_cast<std::uint64_t>(kImages));
}

TEST(LentImages, ComeBackFromTheRingWhenTheTrackerIsStopped) {
  Flight flight(6);
  flight.imu.hold_at = 0;
  flight.camera.hold_at = 5;
  flight.start();
  flight.wait_until([&] { return flight.camera.given == 5; });
  flight.pipeline->stop();
  flight.pipeline->join();
  flight.expect_all_back();
}

// The log thread does not let go of two images; the flight goes on with the other buffers.
TEST(LentImages, ComeBackFromObserversThatHoldThem) {
  Flight flight(6);
  ASSERT_EQ(flight.settings.images_to_log, 2);
  constexpr int kEstimated = 20;  // one by one: none of them is overtaken
  flight.onlooker.held = true;
  flight.camera.hold_at = 0;
  flight.start();
  for (int k = 1; k <= kEstimated; ++k) {
    flight.camera.hold_at = k;
    flight.wait_until([&] { return flight.pipeline->frames_out() == static_cast<std::uint64_t>(k); });
  }
  flight.camera.hold_at = kImages;
  flight.wait_until([&] { return flight.onlooker.images == 1 && flight.camera.given == kImages; });
  EXPECT_FALSE(flight.camera.starved);
  flight.onlooker.held = false;
  const RealtimeReport report = flight.land();
  flight.expect_all_back();
  EXPECT_GE(flight.onlooker.images, 2);
  EXPECT_GE(report.images_not_logged, static_cast<std::uint64_t>(kEstimated) - 2);
  EXPECT_EQ(report.images_not_logged + static_cast<std::uint64_t>(flight.onlooker.images), report.frames_out);
}

TEST(LentImages, ComeBackFromObserversWhenTheFlightIsStopped) {
  Flight flight(8);
  flight.onlooker.held = true;
  flight.start();
  flight.wait_until([&] { return flight.onlooker.images == 1 && flight.camera.given >= kImages / 2; });
  flight.pipeline->stop();
  flight.onlooker.held = false;
  flight.pipeline->join();
  flight.expect_all_back();
  EXPECT_GE(flight.onlooker.images, 1);
}

}  // namespace
}  // namespace epiline
