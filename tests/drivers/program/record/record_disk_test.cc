// Recordings on disks that fill up, are slow, or are pulled out; and what is left on them.
#include <signal.h>
#include <sys/wait.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "drivers/program/record/recording_files.h"
#include "tests/drivers/program/record/record_fixture.h"

namespace epiline {
namespace {

using testing::HasSubstr;

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

using RecordOnDisk = test::Recording;

TEST_F(RecordOnDisk, ADiskThatIsSuddenlyFullEndsItAndWhatWasWrittenIsReadable) {
  FillingDisk disk;
  options.disk = &disk;
  bool is_short = false;
  const Error e = failure_until([&](const RecordState& state) {
    if (state.counts.images >= 5 && !std::exchange(is_short, true)) disk.room = 30'000;  // a part of an image
    return false;
  });
  EXPECT_THAT(e.text(), HasSubstr("cannot be written (No space left on device); expected a disk with room"));
  EXPECT_EQ(e.kind, ErrorKind::kRun);
  expect_readable(5);
  EXPECT_EQ(files_of_images(), open_uncalibrated_asl_dataset(options.out, "cam0")->images.size())
      << "no image is there in part";
}

// A list never names an image that a cut of the power could take.
TEST_F(RecordOnDisk, ImagesAreListedOnceTheyAreOnTheDisk) {
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
  const RecordSummary r = recorded_until([&](const RecordState& state) {
    const std::string list = read(root() / "cam0/data.csv");
    const auto listed = static_cast<std::size_t>(std::count(list.begin(), list.end(), '\n')) - 1;  // the header
    EXPECT_LE(listed, disk.safe.load());
    return state.seconds > 2.5;
  });
  EXPECT_GE(disk.synced, 3) << "twice while it ran, and at the end";
  expect_readable(r.last.counts.images);
}

TEST_F(RecordOnDisk, LinesThatDoNotFitAreCutOff) {
  fs::create_directories(options.out);
  FillingDisk disk;
  LineFile file(disk, options.out / "lines");
  EXPECT_TRUE(file.append("1,2\n3,4\n"));
  disk.room = 2;
  EXPECT_FALSE(file.append("5,6\n"));
  EXPECT_EQ(file.failure(), ENOSPC);
  EXPECT_EQ(read(options.out / "lines"), "1,2\n3,4\n");
  disk.room = 1000;
  EXPECT_FALSE(file.append("7,8\n")) << "there would be a hole";
}

TEST_F(RecordOnDisk, EndsBeforeTheDiskIsFull) {
  FillingDisk disk;
  options.disk = &disk;
  const RecordSummary r = recorded_until([&](const RecordState& state) {
    if (state.counts.images >= 5) disk.free = options.keep_free_bytes - 1;
    return false;
  });
  EXPECT_EQ(r.end, RecordEnd::kDiskFull);
  expect_readable(5);
}

TEST_F(RecordOnDisk, SaysHowLongTheDiskLasts) {
  FillingDisk disk;
  options.disk = &disk;
  disk.free = options.keep_free_bytes + 1'000'000'000;
  const RecordSummary r = recorded_until([](const RecordState& state) { return state.bytes_per_s > 0; });
  std::uint64_t bytes = 0;
  for (const auto& file : fs::recursive_directory_iterator(options.out))
    if (file.path().extension() == ".png") bytes += file.file_size();
  const double per_image = static_cast<double>(bytes) / static_cast<double>(files_of_images());
  EXPECT_NEAR(r.last.seconds_left / (1e9 / (20 * per_image)), 1, 0.3) << "at 20 Hz, with the samples of the IMU";
}

TEST_F(RecordOnDisk, ASlowDiskCostsImagesButNoSamplesAndIsNamed) {
  HeldDisk disk;
  options.disk = &disk;
  options.waiting_bytes = 0;  // four images
  const RecordSummary r = recorded_until([&](const RecordState& state) {
    disk.held = state.counts.images >= 3 && state.counts.images_unwritten < 3;
    return state.counts.images >= 8;
  });
  EXPECT_GE(r.last.counts.images_unwritten, 3u);
  EXPECT_EQ(r.last.counts.readings_unwritten, 0u);
  EXPECT_GT(r.last.write_ms, r.last.compress_ms);
  ASSERT_FALSE(loss_lines(r.last).empty());
  EXPECT_THAT(loss_lines(r.last).front(), HasSubstr("the disk is too slow: an image takes"));
  expect_readable(8);
}

TEST_F(RecordOnDisk, RefusesAFolderThatCannotBeMade) {
  fs::create_directories(options.out);
  std::ofstream(options.out / "file") << "x";
  options.out /= "file";
  const Error e = failure_until([](const RecordState&) { return true; });
  options.out = options.out.parent_path();
  EXPECT_EQ(e.kind, ErrorKind::kUsage);
  EXPECT_EQ(camera->opened, 0);
}

TEST_F(RecordOnDisk, ReplaysOnceACalibrationIsPutInPlace) {
  ASSERT_TRUE(run_until([](const RecordState& state) { return state.counts.images >= 5; }));
  EXPECT_THAT(read(root() / "cam0/sensor.yaml"), HasSubstr("resolution: [320, 240]"));
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

TEST_F(RecordOnDisk, WritesTheCalibrationThatTheConfigurationNames) {
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

TEST_F(RecordOnDisk, OneThatIsKilledIsReadableUpToThen) {
  for (int round = 0; round < 3; ++round) {
    fs::remove_all(options.out);
    const pid_t child = fork();
    if (child == 0) {
      (void)run_until([](const RecordState&) { return false; });
      _exit(1);
    }
    ASSERT_GT(child, 0);
    const fs::path list = root() / "cam0/data.csv";
    for (int i = 0; i < 6000 && read(list).size() < 200; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    std::this_thread::sleep_for(std::chrono::milliseconds(21 * round));
    kill(child, SIGKILL);
    ASSERT_EQ(waitpid(child, nullptr, 0), child);
    expect_readable(3);
  }
}

}  // namespace
}  // namespace epiline
