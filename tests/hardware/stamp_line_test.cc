// Images of vivid stamped by edges of gpio-sim. vivid takes no trigger; it begins when its stream does, and the hand
// that pulses the line counts from there.
#include <atomic>
#include <chrono>
#include <cstdio>
#include <deque>
#include <mutex>
#include <optional>
#include <thread>

#include "platform/concurrency/lock_count.h"
#include "platform/memory/allocation_count.h"
#include "tests/hardware/camera_support.h"
#include "tests/hardware/gpio_support.h"
#include "tests/hardware/support.h"

namespace epiline {
namespace {

constexpr std::int64_t kPeriod_ns = 200'000'000;  // slow: an emulator's images come late

V4l2Settings settings_of_test() {
  V4l2Settings settings;
  settings.device = "/dev/video0";
  settings.width = 320, settings.height = 180;
  settings.rate_hz = 5;
  settings.formats = {PixelFormat::kGrey};
  settings.controls = {{"timestamp_source", 1}};  // start of exposure
  settings.stamp_line = "strobe";
  return settings;
}

/// Pulses at steady times. What the kernel's stamp of each pulse must lie between is kept.
class Strobe {
 public:
  Strobe(const SimulatedGpio& gpio, std::int64_t first_ns)
      : thread_([this, &gpio, first_ns] { pulse(gpio, first_ns); }) {}
  ~Strobe() {
    ends_ = true;
    thread_.join();
  }
  void leave_out(int count) { skip_ = count; }
  /// Whether there was a pulse that a stamp may be of.
  bool has(HostStamp stamp) {
    const std::lock_guard lock(mutex_);
    for (const auto& between : pulses_)
      if (stamp.ns >= between.begin_ns && stamp.ns <= between.end_ns + 30'000'000) return true;
    return false;
  }

 private:
  void pulse(const SimulatedGpio& gpio, std::int64_t next_ns) {
    go_before_programs();
    for (; !ends_; next_ns += kPeriod_ns) {
      std::this_thread::sleep_until(std::chrono::steady_clock::time_point(std::chrono::nanoseconds(next_ns)));
      if (skip_ > 0) {
        --skip_;
        continue;
      }
      const auto between = gpio.edge(0, true);
      {
        const std::lock_guard lock(mutex_);
        pulses_.push_back(between);
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(30));
      gpio.set(0, false);
    }
  }

  std::atomic<bool> ends_{false};
  std::atomic<int> skip_{0};
  std::mutex mutex_;
  std::deque<SimulatedGpio::Between> pulses_;
  std::thread thread_;
};

class StampLineOfTheKernel : public testing::Test {
 protected:
  /// The next image; its stamp must be that of a pulse, and as many periods after the one before as the camera counted
  /// images, whatever was lost between.
  void expect_stamped_image() {
    Frame frame;
    ASSERT_TRUE(read_within(camera_, frame, Span{20 * kSecond.ns}));
    camera_.give_back(frame);
    if (before_) {
      const auto images = static_cast<double>(frame.sequence - before_->sequence);
      EXPECT_NEAR(static_cast<double>((frame.stamp - before_->stamp).ns) / kPeriod_ns, images, 0.2);
    }
    before_ = frame;
    newest_ = frame;
  }
  void open() {
    ASSERT_OPENS(camera_);
    strobe_.emplace(gpio_, monotonic_ns() + kPeriod_ns - 30'000'000);  // 30 ms before each image
  }

  const SimulatedGpio gpio_{"trigger", {"strobe"}};
  V4l2Camera camera_{settings_of_test()};
  std::optional<Strobe> strobe_;
  std::optional<Frame> before_;
  Frame newest_;
};

TEST_F(StampLineOfTheKernel, ImagesGetTheStampsOfTheirEdges) {
  open();
  for (int i = 0; i < 25; ++i) {
    expect_stamped_image();
    EXPECT_TRUE(strobe_->has(newest_.stamp));
  }
  const EdgeCounts edges = camera_.edge_counts();
  std::printf("lag %.1f ms, period %.3f ms, %llu matched, %llu unsure, %llu mismatched\n", edges.lag.seconds() * 1e3,
              edges.period.seconds() * 1e3, static_cast<unsigned long long>(edges.matched),
              static_cast<unsigned long long>(edges.unsure), static_cast<unsigned long long>(edges.mismatched));
  EXPECT_EQ(edges.matched, 25u);
  EXPECT_NEAR(edges.period.seconds() * 1e9, kPeriod_ns, 0.02 * kPeriod_ns);
  EXPECT_EQ(camera_.counts().frames, 25u);
  EXPECT_GE(camera_.counts().no_edge, 12u) << "until it is sure";
}

TEST_F(StampLineOfTheKernel, LostEdgesAndLostImagesDoNotShiftTheOthers) {
  open();
  expect_stamped_image();
  strobe_->leave_out(2);
  for (int i = 0; i < 8; ++i) expect_stamped_image();
  EXPECT_EQ(camera_.edge_counts().missing, 2u);
  EXPECT_EQ(camera_.edge_counts().without_edge, 2u);
  set_controls("/dev/video0", {{"percentage_of_dropped_buffers", 50}});
  const std::uint64_t lost_before = camera_.counts().lost;
  const HeapCallScope heap;
  const std::uint64_t locks = lock_calls_of_this_thread();
  for (int i = 0; i < 10; ++i) expect_stamped_image();
  EXPECT_EQ(heap.calls(), 0u);
  EXPECT_EQ(lock_calls_of_this_thread() - locks, 0u);
  EXPECT_GT(camera_.counts().lost, lost_before);
  EXPECT_TRUE(strobe_->has(newest_.stamp));
  set_controls("/dev/video0", {{"percentage_of_dropped_buffers", 0}});
}

TEST_F(StampLineOfTheKernel, AMissingLineIsAnError) {
  V4l2Settings settings = settings_of_test();
  settings.stamp_line = "flash";
  V4l2Camera camera(settings);
  const Status status = camera.open();
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().text().find("GPIO line flash: no line has this name; expected one of strobe"), 0u);
}

}  // namespace
}  // namespace epiline
