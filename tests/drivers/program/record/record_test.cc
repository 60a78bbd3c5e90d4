// Recordings of a camera and an IMU that stand, on disks that fill up, are slow, or are pulled out.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "drivers/flights/recordings/asl_dataset.h"
#include "drivers/program/record/recorder.h"
#include "drivers/program/record/recording_files.h"
#include "platform/time/monotonic.h"
#include "tests/drivers/program/standing_sensors.h"

namespace epiline {
namespace {

namespace fs = std::filesystem;
using test::StandingCamera;
using test::StandingImu;
using testing::HasSubstr;

std::string text_of_file(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// Takes so many bytes, then only a part of what comes, then nothing.
class FillingDisk : public Disk {
 public:
  std::atomic<std::int64_t> room{std::int64_t{1} << 40};
  std::optional<std::uint64_t> free_bytes(const fs::path& /*folder*/) noexcept override { return free; }
  ssize_t write(int fd, const char* bytes, std::size_t count) noexcept override {
    const std::int64_t before = room.fetch_sub(static_cast<std::int64_t>(count));
    if (before <= 0) return errno = ENOSPC, -1;
    return Disk::write(fd, bytes, std::min(count, static_cast<std::size_t>(before)));
  }
  void remove(const fs::path& file) noexcept override {
    std::error_code none;
    const auto size = fs::file_size(file, none);
    Disk::remove(file);
    room = none ? 0 : static_cast<std::int64_t>(size);
  }
  void sync(const fs::path& folder) noexcept override {
    ++synced;
    Disk::sync(folder);
  }
  std::atomic<std::uint64_t> free{1'000'000'000'000};
  std::atomic<int> synced{0};
};

/// Takes nothing larger than some lines while it is held.
class HeldDisk final : public Disk {
 public:
  std::atomic<bool> held{false};
  ssize_t write(int fd, const char* bytes, std::size_t count) noexcept override {
    while (held && count > 10'000) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return Disk::write(fd, bytes, count);
  }
};

/// Lost between two images, and found again after `lost_reads` attempts.
class LostCamera final : public StandingCamera {
 public:
  int lost_after = 5, lost_reads = 30, skipped = 0;
  ReadOutcome read(Frame& frame, Span timeout) noexcept override {
    if (images_ == lost_after && lost_reads-- > 0) return ReadOutcome::kFailed;
    const ReadOutcome outcome = StandingCamera::read(frame, timeout);
    if (outcome != ReadOutcome::kSample) return outcome;
    if (images_++ >= lost_after) frame.sequence += static_cast<std::uint64_t>(skipped);
    return outcome;
  }

 private:
  int images_ = 0;
};

/// Gives images that no recording may hold: one with the stamp of the image before, one of another size.
class OddCamera final : public StandingCamera {
 public:
  ReadOutcome read(Frame& frame, Span timeout) noexcept override {
    const ReadOutcome outcome = StandingCamera::read(frame, timeout);
    if (outcome != ReadOutcome::kSample) return outcome;
    if (frame.sequence == 3) frame.stamp = last_;
    if (frame.sequence == 5) frame.height -= 2;
    last_ = frame.stamp;
    return outcome;
  }

 private:
  HostStamp last_;
};

/// With a second camera that misses every fourth image, and is a quarter of a millisecond late.
class CameraOfTwo final : public StandingCamera {
 public:
  OtherFrames others(const Frame& frame) const noexcept override {
    if (frame.sequence % 4 == 0) return {};
    Frame second = frame;
    second.stamp.ns += 250'000;
    return {second};
  }
};

class SilentCamera final : public StandingCamera {
 public:
  ReadOutcome read(Frame& /*frame*/, Span timeout) noexcept override {
    std::this_thread::sleep_for(std::chrono::nanoseconds(timeout.ns));
    return ReadOutcome::kTimeout;
  }
};

/// Somebody wants to end it while the devices are being opened.
class EndedAtStart final : public StandingCamera {
 public:
  Status open() override {
    pthread_kill(recording, SIGTERM);
    return StandingCamera::open();
  }
  const pthread_t recording = pthread_self();
};

class StoppingImu final : public StandingImu {
 public:
  int samples_left = 40;
  ReadOutcome read(std::span<ImuSample> samples, std::size_t& count, Span timeout) noexcept override {
    if (samples_left-- > 0) return StandingImu::read(samples, count, timeout);
    std::this_thread::sleep_for(std::chrono::nanoseconds(timeout.ns));
    return ReadOutcome::kTimeout;
  }
};

class RefusedImu final : public StandingImu {
 public:
  Status open() override { return Error{ErrorKind::kRun, "iio:device7", 0, "no such device", "an IMU"}; }
};

class Record : public testing::Test {
 protected:
  Record() {
    settings.source = "record.toml";
    options.out = fs::path(testing::TempDir()) / ("record_" + std::to_string(getpid()) +
                                                  testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(options.out);
    place<StandingCamera>();
    place_imu<StandingImu>();
  }
  ~Record() override { fs::remove_all(options.out); }

  template <class C>
  C& place() {
    auto made = std::make_unique<C>();
    C& c = *made;
    camera = made.get();
    devices.camera = std::move(made);
    return c;
  }
  template <class I>
  I& place_imu() {
    auto made = std::make_unique<I>();
    I& i = *made;
    devices.imu = std::move(made);
    return i;
  }
  /// Until `is_enough`, at most a minute.
  Result<RecordSummary> run_until(const std::function<bool(const RecordState&)>& is_enough) {
    return record(settings, devices, options,
                  [&](const RecordState& state) { return !is_enough(state) && state.seconds < 60; });
  }
  fs::path root() const { return options.out / "mav0"; }
  std::size_t files_of_images() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(root() / "cam0/data"), {}));
  }
  /// What a recording must be at any instant: each listed image is whole, and each line is.
  void expect_readable(std::size_t fewest_images) const {
    for (const char* list : {"cam0/data.csv", "imu0/data.csv"}) {
      const std::string text = text_of_file(root() / list);
      ASSERT_FALSE(text.empty()) << list;
      EXPECT_EQ(text.back(), '\n') << list;
    }
    const auto dataset = open_uncalibrated_asl_dataset(options.out, "cam0");
    ASSERT_TRUE(dataset) << dataset.error().text();
    EXPECT_GE(dataset->images.size(), fewest_images);
    for (const ImageFile& image : dataset->images) {
      const cv::Mat pixels = cv::imread(image.path.string(), cv::IMREAD_UNCHANGED);
      EXPECT_EQ(pixels.cols, StandingCamera::kWidth) << image.path;
      EXPECT_EQ(pixels.rows, StandingCamera::kHeight) << image.path;
    }
  }

  LiveSettings settings;
  LiveDevices devices;
  RecordOptions options;
  StandingCamera* camera = nullptr;
};

TEST_F(Record, ADiskThatIsSuddenlyFullEndsItAndWhatWasWrittenIsReadable) {
  FillingDisk disk;
  options.disk = &disk;
  bool is_short = false;
  const auto r = run_until([&](const RecordState& state) {
    if (state.counts.images >= 5 && !std::exchange(is_short, true)) disk.room = 30'000;  // a part of an image
    return false;
  });
  ASSERT_FALSE(r);
  EXPECT_THAT(r.error().text(), HasSubstr("cannot be written (No space left on device); expected a disk with room"));
  EXPECT_EQ(r.error().kind, ErrorKind::kRun);
  expect_readable(5);
  EXPECT_EQ(files_of_images(), open_uncalibrated_asl_dataset(options.out, "cam0")->images.size())
      << "no image is there in part";
}

TEST_F(Record, TwoCamerasHaveAFolderEach) {
  place<CameraOfTwo>();
  settings.config.devices.camera.side_by_side = static_cast<int>(SideBySideHalves::kLeftFirst);
  const auto r = run_until([](const RecordState& state) { return state.counts.images >= 9; });
  ASSERT_TRUE(r) << r.error().text();
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

// A list never names an image that a cut of the power could take: at any instant what is listed was synced.
TEST_F(Record, ImagesAreListedOnceTheyAreOnTheDisk) {
  class Watching final : public FillingDisk {
   public:
    explicit Watching(fs::path of) : folder(std::move(of)) {}
    void sync(const fs::path& root) noexcept override {
      std::error_code none;
      safe = static_cast<std::size_t>(std::distance(fs::directory_iterator(folder, none), {}));
      FillingDisk::sync(root);
    }
    fs::path folder;
    std::atomic<std::size_t> safe{0};
  } disk(root() / "cam0/data");
  options.disk = &disk;
  const auto r = run_until([&](const RecordState& state) {
    const std::string list = text_of_file(root() / "cam0/data.csv");
    const auto listed = static_cast<std::size_t>(std::count(list.begin(), list.end(), '\n')) - 1;  // the header
    EXPECT_LE(listed, disk.safe.load());
    return state.seconds > 2.5;
  });
  ASSERT_TRUE(r) << r.error().text();
  EXPECT_GE(disk.synced, 3) << "twice while it ran, and at the end";
  expect_readable(r->last.counts.images);
}

TEST_F(Record, LinesThatDoNotFitAreCutOff) {
  fs::create_directories(options.out);
  FillingDisk disk;
  LineFile file(disk, options.out / "lines");
  EXPECT_TRUE(file.append("1,2\n3,4\n"));
  disk.room = 2;
  EXPECT_FALSE(file.append("5,6\n"));
  EXPECT_EQ(file.failure(), ENOSPC);
  EXPECT_EQ(text_of_file(options.out / "lines"), "1,2\n3,4\n");
  disk.room = 1000;
  EXPECT_FALSE(file.append("7,8\n")) << "there would be a hole";
}

TEST_F(Record, EndsBeforeTheDiskIsFull) {
  FillingDisk disk;
  options.disk = &disk;
  const auto r = run_until([&](const RecordState& state) {
    if (state.counts.images >= 5) disk.free = options.keep_free_bytes - 1;
    return false;
  });
  ASSERT_TRUE(r) << r.error().text();
  EXPECT_EQ(r->end, RecordEnd::kDiskFull);
  expect_readable(5);
}

TEST_F(Record, SaysHowLongTheDiskLasts) {
  FillingDisk disk;
  options.disk = &disk;
  disk.free = options.keep_free_bytes + 1'000'000'000;
  const auto r = run_until([](const RecordState& state) { return state.bytes_per_s > 0; });
  ASSERT_TRUE(r) << r.error().text();
  std::uint64_t bytes = 0;
  for (const auto& file : fs::recursive_directory_iterator(options.out))
    if (file.path().extension() == ".png") bytes += file.file_size();
  const double per_image = static_cast<double>(bytes) / static_cast<double>(files_of_images());
  EXPECT_NEAR(r->last.seconds_left / (1e9 / (20 * per_image)), 1, 0.3) << "at 20 Hz, with the samples of the IMU";
}

TEST_F(Record, DoesNotBeginOnAFullDisk) {
  FillingDisk disk;
  options.disk = &disk;
  disk.free = 1'000'000;
  const auto r = run_until([](const RecordState&) { return true; });
  ASSERT_FALSE(r);
  EXPECT_EQ(r.error().kind, ErrorKind::kUsage);
  EXPECT_THAT(r.error().text(), HasSubstr("1 MB are free; expected more than the 200 MB"));
  EXPECT_EQ(camera->opened, 0);
  EXPECT_FALSE(fs::exists(root()));
}

TEST_F(Record, ASlowDiskCostsImagesButNoSamplesAndIsNamed) {
  HeldDisk disk;
  options.disk = &disk;
  options.waiting_bytes = 0;  // four images
  const auto r = run_until([&](const RecordState& state) {
    disk.held = state.counts.images >= 3 && state.counts.images_unwritten < 3;
    return state.counts.images >= 8;
  });
  ASSERT_TRUE(r) << r.error().text();
  EXPECT_GE(r->last.counts.images_unwritten, 3u);
  EXPECT_EQ(r->last.counts.readings_unwritten, 0u);
  EXPECT_GT(r->last.write_ms, r->last.compress_ms);
  ASSERT_FALSE(loss_lines(r->last).empty());
  EXPECT_THAT(loss_lines(r->last).front(), HasSubstr("the disk is too slow: an image takes"));
  expect_readable(8);
}

TEST_F(Record, GoesOnWithoutACameraAndTakesItBack) {
  auto& lost = place<LostCamera>();
  lost.skipped = 7;
  double longest_silence_s = 0;
  const auto r = run_until([&](const RecordState& state) {
    longest_silence_s = std::max(longest_silence_s, state.camera_silent_s);
    return state.counts.images >= 10;
  });
  ASSERT_TRUE(r) << r.error().text();
  EXPECT_EQ(r->last.counts.images_missed, 7u);
  EXPECT_GT(longest_silence_s, 0.2);
  EXPECT_THAT(loss_lines(r->last), testing::Contains(HasSubstr("7 images: the camera or its driver")));
  expect_readable(10);
}

TEST_F(Record, GoesOnWithoutAnImu) {
  place_imu<StoppingImu>();
  const auto r = run_until([](const RecordState& state) { return state.imu_silent_s > 0.5; });
  ASSERT_TRUE(r) << r.error().text();
  EXPECT_EQ(r->last.counts.readings, 40u);
  expect_readable(5);
}

TEST_F(Record, SaysThatNoImageCame) {
  place<SilentCamera>();
  options.duration_s = 0.3;
  const auto r = run_until([](const RecordState&) { return false; });
  ASSERT_FALSE(r);
  EXPECT_EQ(r.error().kind, ErrorKind::kRun);
  EXPECT_THAT(r.error().text(), HasSubstr("no image came from the camera in 0."));
}

TEST_F(Record, LeavesOutImagesThatDoNotBelong) {
  place<OddCamera>();
  const auto r = run_until([](const RecordState& state) { return state.counts.images >= 8; });
  ASSERT_TRUE(r) << r.error().text();
  EXPECT_EQ(r->last.counts.images_old, 1u);
  EXPECT_EQ(r->last.counts.images_resized, 1u);
  expect_readable(8);
}

TEST_F(Record, EndsOnASignalWithEverythingWritten) {
  const pthread_t self = pthread_self();
  RecordState before;
  const auto r = run_until([&](const RecordState& state) {
    before = state;
    if (state.counts.images >= 5) pthread_kill(self, SIGINT);
    return false;
  });
  ASSERT_TRUE(r) << r.error().text();
  EXPECT_EQ(r->end, RecordEnd::kSignal);
  EXPECT_LT(r->last.seconds, 59);
  expect_readable(before.counts.images);
  EXPECT_EQ(r->last.counts.images, open_uncalibrated_asl_dataset(options.out, "cam0")->images.size());
  EXPECT_EQ(camera->closed, 1);
}

TEST_F(Record, ASignalDuringTheStartLeavesNothingBehind) {
  place<EndedAtStart>();
  place_imu<StoppingImu>().samples_left = 0;
  const auto r = run_until([](const RecordState&) { return false; });
  if (!r) {
    EXPECT_THAT(r.error().text(), HasSubstr("ended before all devices were open"));
  } else {
    EXPECT_EQ(r->end, RecordEnd::kSignal);  // they were just open
  }
  EXPECT_EQ(camera->closed, 1);
  EXPECT_TRUE((r && r->last.counts.images > 0) || !fs::exists(root()));
}

/// Waits for its first sample until the recorder stops it.
class WaitingImu final : public StandingImu {
 public:
  Status open() override {
    while (!gives_up) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return Error{ErrorKind::kRun, "IMU", 0, "no samples", ""};
  }
  void give_up() noexcept override { gives_up = true; }
  std::atomic<bool> gives_up{false};
};

TEST_F(Record, ASignalEndsTheWaitForADeviceWithAWord) {
  place_imu<WaitingImu>();
  const pthread_t self = pthread_self();
  std::thread stopper([self] {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    pthread_kill(self, SIGTERM);
  });
  const std::int64_t begin_ns = monotonic_ns();
  const auto r = run_until([](const RecordState&) { return false; });
  const double seconds = 1e-9 * static_cast<double>(monotonic_ns() - begin_ns);
  stopper.join();
  ASSERT_FALSE(r);
  EXPECT_THAT(r.error().text(), HasSubstr("ended before all devices were open"));
  EXPECT_LT(seconds, 0.1 + 0.2 + 0.5) << "0.2 s, and what a busy computer adds";
  EXPECT_FALSE(fs::exists(root()));
}

TEST_F(Record, RefusesAFolderWithARecording) {
  fs::create_directories(root() / "cam0");
  const auto r = run_until([](const RecordState&) { return true; });
  ASSERT_FALSE(r);
  EXPECT_EQ(r.error().kind, ErrorKind::kUsage);
  EXPECT_THAT(r.error().text(), HasSubstr("mav0: exists already; expected a folder without a recording"));
  EXPECT_TRUE(fs::exists(root() / "cam0")) << "it is not ours to remove";
  EXPECT_EQ(camera->opened, 0);
}

TEST_F(Record, RefusesAFolderThatCannotBeMade) {
  fs::create_directories(options.out);
  std::ofstream(options.out / "file") << "x";
  options.out /= "file";
  const auto r = run_until([](const RecordState&) { return true; });
  options.out = options.out.parent_path();
  ASSERT_FALSE(r);
  EXPECT_EQ(r.error().kind, ErrorKind::kUsage);
  EXPECT_EQ(camera->opened, 0);
}

TEST_F(Record, ADeviceThatCannotBeOpenedLeavesNoRecordingBehind) {
  place_imu<RefusedImu>();
  const auto r = run_until([](const RecordState&) { return true; });
  ASSERT_FALSE(r);
  EXPECT_EQ(r.error().text(), "iio:device7: no such device; expected an IMU");
  EXPECT_FALSE(fs::exists(root())) << "the next attempt would be refused";
}

TEST_F(Record, HoldsThePixelsAndNumbersThatTheDevicesGave) {
  class Keeping final : public StandingCamera {
   public:
    std::vector<std::pair<HostStamp, std::vector<std::uint8_t>>> given;
    ReadOutcome read(Frame& frame, Span timeout) noexcept override {
      const ReadOutcome outcome = StandingCamera::read(frame, timeout);
      if (outcome == ReadOutcome::kSample && given.size() < 10)
        given.emplace_back(frame.stamp, std::vector<std::uint8_t>(frame.data, frame.data + kWidth * kHeight));
      return outcome;
    }
  };
  class KeepingImu final : public StandingImu {
   public:
    std::vector<ImuSample> given;
    ReadOutcome read(std::span<ImuSample> samples, std::size_t& count, Span timeout) noexcept override {
      const ReadOutcome outcome = StandingImu::read(samples, count, timeout);
      if (given.size() < 20) given.insert(given.end(), samples.begin(), samples.begin() + 1);
      return outcome;
    }
  };
  const auto& kept = place<Keeping>();
  const auto& imu = place_imu<KeepingImu>();
  const auto r = run_until([](const RecordState& state) { return state.counts.images >= 10; });
  ASSERT_TRUE(r) << r.error().text();
  const auto dataset = open_uncalibrated_asl_dataset(options.out, "cam0");
  ASSERT_TRUE(dataset) << dataset.error().text();
  ASSERT_GE(dataset->images.size(), kept.given.size());
  for (std::size_t i = 0; i < kept.given.size(); ++i) {
    EXPECT_EQ(dataset->images[i].stamp, kept.given[i].first);
    const cv::Mat pixels = cv::imread(dataset->images[i].path.string(), cv::IMREAD_UNCHANGED);
    ASSERT_TRUE(pixels.isContinuous());
    EXPECT_EQ(std::vector<std::uint8_t>(pixels.datastart, pixels.dataend), kept.given[i].second) << i;
  }
  ASSERT_GE(dataset->imu_samples.size(), imu.given.size());
  for (std::size_t i = 0; i < imu.given.size(); ++i) {
    EXPECT_EQ(dataset->imu_samples[i].stamp, imu.given[i].stamp);
    EXPECT_EQ(dataset->imu_samples[i].angular_velocity_rad_s, imu.given[i].angular_velocity_rad_s);
    EXPECT_EQ(dataset->imu_samples[i].specific_force_m_s2, imu.given[i].specific_force_m_s2);
  }
}

TEST_F(Record, ReplaysOnceACalibrationIsPutInPlace) {
  ASSERT_TRUE(run_until([](const RecordState& state) { return state.counts.images >= 5; }));
  EXPECT_THAT(text_of_file(root() / "cam0/sensor.yaml"), HasSubstr("resolution: [320, 240]"));
  const auto without = open_asl_dataset(options.out, "cam0");
  ASSERT_FALSE(without);
  EXPECT_THAT(without.error().text(), HasSubstr("cam0/sensor.yaml: holds no calibration; expected one in its place"));
  const char* const calibration =
      "T_BS: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\nresolution: [320, 240]\ncamera_model: pinhole\n"
      "intrinsics: [250, 250, 160, 120]\ndistortion_model: none\n";
  std::ofstream(options.out / "camera.yaml") << calibration;
  const auto beside = open_asl_dataset(options.out, "cam0", options.out / "camera.yaml");
  ASSERT_TRUE(beside) << beside.error().text();
  EXPECT_THAT(beside->notes, testing::ElementsAre(HasSubstr("imu0/sensor.yaml holds no calibration: assuming")));
  fs::rename(options.out / "camera.yaml", root() / "cam0/sensor.yaml");
  const auto placed = open_asl_dataset(options.out, "cam0");
  ASSERT_TRUE(placed) << placed.error().text();
  EXPECT_EQ(placed->camera.parameters.intrinsics[0], 250);
}

TEST_F(Record, WritesTheCalibrationThatTheConfigurationNames) {
  settings.camera.width = 320;
  settings.camera.height = 240;
  settings.camera.intrinsics = {250, 251, 160, 120};
  settings.config.imu_calibration = "imu.yaml";
  settings.config.estimator.imu.gyroscope_density = 0.00125;
  ASSERT_TRUE(run_until([](const RecordState& state) { return state.counts.images >= 3; }));
  const auto dataset = open_asl_dataset(options.out, "cam0");
  ASSERT_TRUE(dataset) << dataset.error().text();
  EXPECT_EQ(dataset->camera.parameters.intrinsics[1], 251);
  EXPECT_EQ(dataset->imu.noise.gyroscope_density, 0.00125);
  EXPECT_TRUE(dataset->notes.empty());
}

TEST_F(Record, OneThatIsKilledIsReadableUpToThen) {
  for (int round = 0; round < 5; ++round) {
    fs::remove_all(options.out);
    const pid_t child = fork();
    if (child == 0) {
      (void)run_until([](const RecordState&) { return false; });
      _exit(1);
    }
    ASSERT_GT(child, 0);
    const fs::path list = root() / "cam0/data.csv";
    for (int i = 0; i < 6000 && text_of_file(list).size() < 200; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    std::this_thread::sleep_for(std::chrono::milliseconds(13 * round));
    kill(child, SIGKILL);
    ASSERT_EQ(waitpid(child, nullptr, 0), child);
    expect_readable(3);
  }
}

}  // namespace
}  // namespace epiline
