// Recordings of devices that are lost, silent, odd, or not there.
#include <signal.h>

#include <algorithm>
#include <atomic>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "platform/time/monotonic.h"
#include "tests/drivers/program/record/record_fixture.h"

namespace epiline {
namespace {

using test::StandingCamera;
using test::StandingImu;
using testing::HasSubstr;

/// A camera that stands, and does what a test wants besides.
class AlteredCamera final : public StandingCamera {
 public:
  std::function<void()> at_open;                        ///< each may be empty
  std::function<std::optional<ReadOutcome>()> instead;  ///< of reading an image; nothing: an image is read
  std::function<void(Frame&)> alter;                    ///< of each image
  std::function<OtherFrames(const Frame&)> beside;      ///< what the other cameras have

  Status open() override {
    if (at_open) at_open();
    return StandingCamera::open();
  }
  ReadOutcome read(Frame& frame, Span timeout) noexcept override {
    if (instead)
      if (const auto outcome = instead()) return *outcome;
    const ReadOutcome outcome = StandingCamera::read(frame, timeout);
    if (outcome == ReadOutcome::kSample && alter) alter(frame);
    return outcome;
  }
  OtherFrames others(const Frame& frame) const noexcept override { return beside ? beside(frame) : OtherFrames{}; }
};

class AlteredImu final : public StandingImu {
 public:
  std::function<Status()> opens;
  std::function<void(const ImuSample&)> see;
  std::atomic<int> samples_left{1'000'000};
  std::atomic<bool> gives_up{false};

  Status open() override { return opens ? opens() : StandingImu::open(); }
  void give_up() noexcept override { gives_up = true; }
  ReadOutcome read(std::span<ImuSample> samples, std::size_t& count, Span timeout) noexcept override {
    if (samples_left-- <= 0) {
      std::this_thread::sleep_for(std::chrono::nanoseconds(timeout.ns));
      return ReadOutcome::kTimeout;
    }
    const ReadOutcome outcome = StandingImu::read(samples, count, timeout);
    if (see) see(samples[0]);
    return outcome;
  }
};

using Record = test::Recording;

TEST_F(Record, TwoCamerasHaveAFolderEach) {
  // the second one misses every fourth image, and is a quarter of a millisecond late
  place<AlteredCamera>().beside = [](const Frame& frame) -> OtherFrames {
    if (frame.sequence % 4 == 0) return {};
    Frame second = frame;
    second.stamp.ns += 250'000;
    return {second};
  };
  settings.config.devices.camera.side_by_side = static_cast<int>(SideBySideHalves::kLeftFirst);
  const RecordSummary r = recorded_until([](const RecordState& state) { return state.counts.images >= 9; });
  expect_readable(9);
  const auto first = open_uncalibrated_asl_dataset(options.out, "cam0"),
             second = open_uncalibrated_asl_dataset(options.out, "cam1");
  ASSERT_TRUE(first && second);
  ASSERT_GE(second->images.size(), 6u);
  std::size_t k = 0;
  for (std::size_t i = 0; i < first->images.size(); ++i) {
    if (i % 4 == 0) continue;
    ASSERT_LT(k, second->images.size());
    EXPECT_EQ((second->images[k].stamp - first->images[i].stamp).ns, 250'000);
    const cv::Mat a = cv::imread(first->images[i].path.string(), cv::IMREAD_UNCHANGED),
                  b = cv::imread(second->images[k].path.string(), cv::IMREAD_UNCHANGED);
    EXPECT_TRUE(std::equal(a.datastart, a.dataend, b.datastart, b.dataend)) << "pixels of the partner";
    ++k;
  }
  EXPECT_EQ(k, second->images.size());
  EXPECT_TRUE(fs::exists(root() / "cam1/sensor.yaml"));
}

TEST_F(Record, GoesOnWithoutACameraAndTakesItBack) {
  auto& lost = place<AlteredCamera>();
  int images = 0, failures_left = 30;
  lost.instead = [&]() -> std::optional<ReadOutcome> {
    if (images == 5 && failures_left-- > 0) return ReadOutcome::kFailed;
    return std::nullopt;
  };
  lost.alter = [&](Frame& frame) {
    if (images++ >= 5) frame.sequence += 7;
  };
  double longest_silence_s = 0;
  const RecordSummary r = recorded_until([&](const RecordState& state) {
    longest_silence_s = std::max(longest_silence_s, state.camera_silent_s);
    return state.counts.images >= 10;
  });
  EXPECT_EQ(r.last.counts.images_missed, 7u);
  EXPECT_GT(longest_silence_s, 0.2);
  EXPECT_THAT(loss_lines(r.last), testing::Contains(HasSubstr("7 images: the camera or its driver")));
  expect_readable(10);
}

TEST_F(Record, GoesOnWithoutAnImu) {
  place_imu<AlteredImu>().samples_left = 40;
  const RecordSummary r = recorded_until([](const RecordState& state) { return state.imu_silent_s > 0.5; });
  EXPECT_EQ(r.last.counts.readings, 40u);
  expect_readable(5);
}

TEST_F(Record, SaysThatNoImageCame) {
  place<AlteredCamera>().instead = []() -> std::optional<ReadOutcome> {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    return ReadOutcome::kTimeout;
  };
  options.duration_s = 0.3;
  const Error e = failure_until([](const RecordState&) { return false; });
  EXPECT_EQ(e.kind, ErrorKind::kRun);
  EXPECT_THAT(e.text(), HasSubstr("no image came from the camera in 0."));
}

TEST_F(Record, LeavesOutImagesThatDoNotBelong) {
  place<AlteredCamera>().alter = [last = HostStamp{}](Frame& frame) mutable {
    if (frame.sequence == 3) frame.stamp = last;  // that of the image before
    if (frame.sequence == 5) frame.height -= 2;
    last = frame.stamp;
  };
  const RecordSummary r = recorded_until([](const RecordState& state) { return state.counts.images >= 8; });
  EXPECT_EQ(r.last.counts.images_old, 1u);
  EXPECT_EQ(r.last.counts.images_resized, 1u);
  expect_readable(8);
}

TEST_F(Record, EndsOnASignalWithEverythingWritten) {
  const pthread_t self = pthread_self();
  RecordState before;
  const RecordSummary r = recorded_until([&](const RecordState& state) {
    before = state;
    if (state.counts.images >= 5) pthread_kill(self, SIGINT);
    return false;
  });
  EXPECT_EQ(r.end, RecordEnd::kSignal);
  EXPECT_LT(r.last.seconds, 59);
  expect_readable(before.counts.images);
  EXPECT_EQ(r.last.counts.images, open_uncalibrated_asl_dataset(options.out, "cam0")->images.size());
  EXPECT_EQ(camera->closed, 1);
}

TEST_F(Record, ASignalDuringTheStartLeavesNothingBehind) {
  place<AlteredCamera>().at_open = [self = pthread_self()] { pthread_kill(self, SIGTERM); };
  place_imu<AlteredImu>().samples_left = 0;
  const auto r = run_until([](const RecordState&) { return false; });
  if (!r) {
    EXPECT_THAT(r.error().text(), HasSubstr("ended before all devices were open"));
  } else {
    EXPECT_EQ(r->end, RecordEnd::kSignal);  // they were just open
  }
  EXPECT_EQ(camera->closed, 1);
  EXPECT_TRUE((r && r->last.counts.images > 0) || !fs::exists(root()));
}

TEST_F(Record, ASignalEndsTheWaitForADeviceWithAWord) {
  auto& imu = place_imu<AlteredImu>();  // waits for its first sample until the recorder stops it
  imu.opens = [&]() -> Status {
    while (!imu.gives_up) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return Error{ErrorKind::kRun, "IMU", 0, "no samples", ""};
  };
  const pthread_t self = pthread_self();
  std::thread stopper([self] {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    pthread_kill(self, SIGTERM);
  });
  const std::int64_t begin_ns = monotonic_ns();
  const Error e = failure_until([](const RecordState&) { return false; });
  const double seconds = 1e-9 * static_cast<double>(monotonic_ns() - begin_ns);
  stopper.join();
  EXPECT_THAT(e.text(), HasSubstr("ended before all devices were open"));
  EXPECT_LT(seconds, 0.1 + 0.2 + 0.5) << "0.2 s, and what a busy computer adds";
  EXPECT_FALSE(fs::exists(root()));
}

TEST_F(Record, HoldsThePixelsAndNumbersThatTheDevicesGave) {
  std::vector<std::pair<HostStamp, std::vector<std::uint8_t>>> images;
  std::vector<ImuSample> samples;
  place<AlteredCamera>().alter = [&](Frame& frame) {
    if (images.size() == 10) return;
    images.emplace_back(frame.stamp, std::vector<std::uint8_t>(frame.data, frame.data + frame.width * frame.height));
  };
  place_imu<AlteredImu>().see = [&](const ImuSample& sample) {
    if (samples.size() < 20) samples.push_back(sample);
  };
  const RecordSummary r = recorded_until([](const RecordState& state) { return state.counts.images >= 10; });
  const auto dataset = open_uncalibrated_asl_dataset(options.out, "cam0");
  ASSERT_TRUE(dataset) << dataset.error().text();
  ASSERT_GE(dataset->images.size(), images.size());
  for (std::size_t i = 0; i < images.size(); ++i) {
    EXPECT_EQ(dataset->images[i].stamp, images[i].first);
    const cv::Mat pixels = cv::imread(dataset->images[i].path.string(), cv::IMREAD_UNCHANGED);
    ASSERT_TRUE(pixels.isContinuous());
    EXPECT_EQ(std::vector<std::uint8_t>(pixels.datastart, pixels.dataend), images[i].second) << i;
  }
  ASSERT_GE(dataset->imu_samples.size(), samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    EXPECT_EQ(dataset->imu_samples[i].stamp, samples[i].stamp);
    EXPECT_EQ(dataset->imu_samples[i].angular_velocity_rad_s, samples[i].angular_velocity_rad_s);
    EXPECT_EQ(dataset->imu_samples[i].specific_force_m_s2, samples[i].specific_force_m_s2);
  }
}

}  // namespace
}  // namespace epiline
