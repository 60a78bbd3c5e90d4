// The threads between made-up devices: what they hand out, and what they do when a device does not behave. The body
// rests and looks at points that rest, so every odometry is known. Run under the thread sanitizer too.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "pipeline/realtime/realtime_pipeline.h"
#include "tests/pipeline/realtime/resting_imu.h"

namespace epiline {
namespace {

using test::kReadingRate;
using test::nap;
using test::reading_stamp;

constexpr int kImageEvery = 10, kPoints = 60;
constexpr double kSeconds = 4;

/// Images whose tracks are recorded: without pixels. The next one comes when the one before is done, or `ahead` of it.
class FakeCamera final : public CameraSource {
 public:
  FakeCamera(int images, const std::atomic<int>& done) : images_(images), done_(done) {}
  Status open() override { return Done{}; }
  void close() noexcept override {}
  ReadOutcome read(Frame& frame, Span) noexcept override {
    if (next_ == images_) return ReadOutcome::kEnd;
    if (next_ >= done_.load() + ahead) {
      nap();
      return ReadOutcome::kTimeout;
    }
    frame = {};
    frame.stamp = reading_stamp(kImageEvery * next_);
    frame.sequence = static_cast<std::uint64_t>(next_);
    frame.slot = next_ % 128;
    ++next_;
    return ReadOutcome::kSample;
  }
  void give_back(const Frame&) noexcept override { ++returned; }

  std::atomic<int> returned{0};
  int ahead = 1;  ///< images given before the first of them is done

 private:
  int images_, next_ = 0;
  const std::atomic<int>& done_;
};

class FakeSink final : public OdometrySink {
 public:
  Status open() override { return Done{}; }
  void close() noexcept override {}
  bool publish(const Odometry& odometry) noexcept override {
    while (blocked) nap();
    if (rates.size() < rates.capacity()) rates.push_back(odometry);
    return true;
  }
  bool publish_image(const Odometry& odometry) noexcept override {
    if (images.size() < images.capacity()) images.push_back(odometry);
    return true;
  }

  FakeSink() {
    rates.reserve(20000);
    images.reserve(1000);
  }
  std::vector<Odometry> rates, images;
  std::atomic<bool> blocked{false};
};

class Counter final : public FlightObserver {
 public:
  explicit Counter(std::atomic<int>& done) : done_(done) {}
  void take(const FrameOutcome& outcome) noexcept override {
    solved += outcome.result.solved;
    with_pose += outcome.result.has_pose;
    ++done_;
  }
  int solved = 0, with_pose = 0;

 private:
  std::atomic<int>& done_;
};

class Realtime : public testing::Test {
 protected:
  explicit Realtime(double seconds = kSeconds)
      : readings_(static_cast<int>(seconds * kReadingRate) + 2),
        images_(static_cast<int>(seconds * kReadingRate) / kImageEvery),
        imu_(readings_),
        camera_(images_, done_),
        counter_(done_) {
    std::mt19937 random(3);
    std::normal_distribution<float> noise(0, 0.2F);
    for (int k = 0; k < images_; ++k) {
      for (std::uint32_t id = 0; id < kPoints; ++id) {
        const std::uint32_t column = id % 10, row = id / 10;
        points_.push_back({id, 60 + 70.0F * static_cast<float>(column) + noise(random),
                           50 + 70.0F * static_cast<float>(row) + noise(random)});
      }
    }
    settings_.camera = {CameraModel::kPinholeRadialTangential, 752, 480, {458, 457, 367, 248}, {}};
    settings_.images = false;
    for (int k = 0; k < images_; ++k)
      settings_.recorded.emplace_back(points_.data() + static_cast<std::size_t>(k) * kPoints, kPoints);
    // at rest nothing tells it, and with more than 1 ms of it an image waits for a reading that feed() holds back
    settings_.estimator.estimate_time_offset = false;
    settings_.realtime.deadline_ms = 0;
    settings_.realtime.imu_wait_ms = 3.6e6;  // longer than any machine is busy
    settings_.realtime.lock_memory = false;
    settings_.realtime.priority = 0;
  }

  void start() {
    pipeline_ = std::make_unique<RealtimePipeline>(settings_, RealtimePorts{&camera_, &imu_, &sink_, {&counter_}, {}});
    pipeline_->arm(far_ahead());
  }
  /// The flight is an hour ahead of the clock: on a machine that stands still for a while, no sensor seems silent.
  static Pace far_ahead() { return {test::kFirstReading, monotonic_ns() + 3'600'000'000'000, 1}; }
  void wait_until(const std::function<bool()>& what) {
    while (!what() && !pipeline_->finished()) nap();
  }
  RealtimeReport finish() {
    wait_until([] { return false; });
    pipeline_->join();
    return pipeline_->report();
  }
  /// Lets the IMU go on with the images, as it does in a flight, until so many are done. The next one waits until the
  /// publisher has this one's estimate, unless the receiver blocks: a publisher that is behind leaves estimates out.
  void feed(int images) {
    for (int k = 1; k <= images; ++k) {
      imu_.hold_at = kImageEvery * (k - 1) + 1;
      wait_until([&] { return done_ >= k && (sink_.blocked || has_published(k)); });
    }
  }
  bool has_published(int images) const { return pipeline_->progress().published >= static_cast<std::uint64_t>(images); }
  RealtimeReport fly() {
    imu_.hold_at = 0;
    start();
    feed(images_);
    imu_.hold_at = test::RestingImu::kNever;
    return finish();
  }

  /// Each reading since the first pose once, in order, nothing left out and no jump; each image's pose.
  void expect_complete(const RealtimeReport& report) {
    EXPECT_EQ(report.frames_in, static_cast<std::uint64_t>(images_));
    EXPECT_EQ(report.frames_out + report.frames_overtaken, report.frames_in);
    EXPECT_EQ(report.predicted, sink_.rates.size());
    ASSERT_FALSE(sink_.rates.empty());
    for (std::size_t i = 1; i < sink_.rates.size(); ++i) {
      ASSERT_EQ((sink_.rates[i].stamp - sink_.rates[i - 1].stamp).ns, 1'000'000'000 / kReadingRate) << i;
      for (std::size_t k = 0; k < 3; ++k) {
        EXPECT_NEAR(sink_.rates[i].p_WB_m[k], sink_.rates[i - 1].p_WB_m[k], 0.005) << i;
        EXPECT_NEAR(sink_.rates[i].v_WB_m_s[k], 0, 0.1);
      }
    }
    EXPECT_EQ(report.published + report.superseded, report.frames_out);
  }

  int readings_, images_;
  std::atomic<int> done_{0};
  test::RestingImu imu_;
  FakeCamera camera_;
  FakeSink sink_;
  Counter counter_;
  std::vector<TrackPoint> points_;
  RealtimeSettings settings_;
  std::unique_ptr<RealtimePipeline> pipeline_;
};

TEST_F(Realtime, EveryReadingBringsAnOdometryOfItsInstant) {
  const RealtimeReport report = fly();
  expect_complete(report);
  EXPECT_GT(sink_.rates.size(), 2.5 * kReadingRate);
  EXPECT_EQ(report.superseded, 0u) << "the publisher was waited for";
  EXPECT_EQ(sink_.images.size(), static_cast<std::size_t>(counter_.with_pose));
  EXPECT_GT(sink_.images.size(), 2.5 * kReadingRate / kImageEvery);
  EXPECT_GT(report.prediction.corrections, 20u);
  EXPECT_LE(report.prediction.corrections, static_cast<std::uint64_t>(counter_.solved));
  EXPECT_EQ(report.prediction.old, 0u) << "an image that was only predicted must not correct";
  EXPECT_EQ(report.prediction.jumps, 1u) << "the first";
  EXPECT_EQ(report.prediction_latency.count(), report.predicted);
  EXPECT_EQ(report.publish_failed + report.predict_failed, 0u);
  EXPECT_EQ(pipeline_->estimator().odometry().health.state, HealthState::kTracking);
  EXPECT_NEAR(sink_.rates.back().p_WB_m[2], 0, 0.02);
}

/// The estimator waits for readings that do not come; the tracker has no use for them here. It gives the first image
/// back when it has tracked the second one, and must not track the third one.
TEST_F(Realtime, OneImageIsTrackedWhileTheOneBeforeIsEstimated) {
  camera_.ahead = 3;
  imu_.hold_at = 0;
  start();
  wait_until([&] { return camera_.returned >= 1; });
  EXPECT_EQ(done_, 0);
  for (int i = 0; i < 20; ++i) nap();  // a third one would be tracked now
  pipeline_->stop();
  pipeline_->join();
  for (const auto& ring : pipeline_->report().rings) {
    if (std::string(ring.name) == "tracked") {
      EXPECT_EQ(ring.high_water, 2u);
    }
  }
}

/// A processor that no computer has is refused for the thread that is configured to run there, and for no other.
TEST_F(Realtime, EachThreadHasItsOwnProcessor) {
  for (const char* const name : kFlightThreadNames) {
    settings_.realtime.cpus = {{name, 1'000'000}};
    RealtimePipeline pipeline(settings_, RealtimePorts{&camera_, &imu_, &sink_, {&counter_}, {}});
    pipeline.stop();
    pipeline.join();
    std::size_t found = 0;
    for (const RealtimeReport::Thread& thread : pipeline.report().threads) {
      const bool is_it = std::string(thread.name) == name;
      found += is_it ? 1 : 0;
      EXPECT_EQ(thread.shortfall.cpu, is_it) << name << ": " << thread.name;
    }
    EXPECT_EQ(found, 1u) << name;
  }
}

class RealtimeForLong : public Realtime {
 protected:
  RealtimeForLong() : Realtime(26) {}
};

// A receiver that blocks holds up nothing but itself; what it misses is counted.
TEST_F(RealtimeForLong, AReceiverThatBlocksLosesReadingsAndTheyAreCounted) {
  imu_.hold_at = 0;
  sink_.blocked = true;
  start();
  feed(images_);
  imu_.hold_at = test::RestingImu::kNever;
  wait_until([&] { return imu_.given >= readings_; });
  sink_.blocked = false;
  const RealtimeReport report = finish();
  EXPECT_EQ(report.frames_out, static_cast<std::uint64_t>(images_));
  for (const auto& ring : report.rings) {
    if (std::string(ring.name) == "imu_to_publish") {
      EXPECT_GT(ring.dropped, 500u);
      EXPECT_EQ(ring.passed + ring.dropped, static_cast<std::uint64_t>(readings_));
    }
  }
}

}  // namespace
}  // namespace epiline
