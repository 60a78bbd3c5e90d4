// The IMU of one IIO device or of two, on a folder that looks like sysfs.
#include "drivers/sensors/imu/iio_imu.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "platform/time/monotonic.h"
#include "tests/drivers/sensors/imu/fake_sysfs.h"

namespace epiline {
namespace {

namespace fs = std::filesystem;
using test::FakeSysfs;

// A broken or hostile sensor may say what it likes: stamps handed out rise, and are not ahead of now.
TEST_F(FakeSysfs, WildTimesDoNotComeThrough) {
  ImuDeviceConfig config;
  config.device = "adis16470";
  for (const bool of_host : {true, false}) {
    IioImu imu(config, roots());
    EXPECT_EQ(imu.rate_hz(), 0) << "not open";
    const Status status = imu.open();
    ASSERT_TRUE(status) << status.error().text();
    EXPECT_EQ(imu.rate_hz(), 200);
    const int writer = ::open((root_ + "/dev/iio:device3").c_str(), O_RDWR | O_NONBLOCK);
    ASSERT_GE(writer, 0);
    std::mt19937_64 random(of_host ? 1 : 2);
    HostStamp last;
    std::size_t good = 0, handed_out = 0;
    const std::int64_t begin_ns = monotonic_ns();
    for (int i = 0; i < 3'000; ++i) {
      // mostly readings 1 us apart of a clock of its own, or the host's; in between anything
      const bool is_wild = random() % 16 == 0;
      const std::int64_t now_ns = monotonic_ns();
      std::int64_t stamp_ns = of_host ? now_ns : now_ns - begin_ns + 1'000'000'000'000'000;
      if (is_wild) stamp_ns = static_cast<std::int64_t>(random() >> (random() % 64));
      good += is_wild ? 0 : 1;
      std::array<std::uint8_t, 24> scan{};
      std::memcpy(scan.data() + 16, &stamp_ns, 8);
      ASSERT_EQ(::write(writer, scan.data(), scan.size()), static_cast<ssize_t>(scan.size()));
      if (random() % 3 == 0) continue;  // several at once
      std::array<ImuSample, 8> samples;
      std::size_t count = 0;
      imu.read(samples, count, Span{0});
      for (std::size_t k = 0; k < count; ++k) {
        EXPECT_GT(samples[k].stamp, last);
        EXPECT_LE(samples[k].stamp.ns, monotonic_ns() + 1'000'000);
        last = samples[k].stamp;
      }
      handed_out += count;
    }
    EXPECT_GT(handed_out, 0u);
    EXPECT_GT(imu.counts().bad_stamps + imu.counts().disordered, 100u);
    std::printf("%zu of %zu good readings handed out, opened anew %llu times\n", handed_out, good,
                static_cast<unsigned long long>(imu.counts().disconnected));
    ::close(writer);
  }
}

/// The fixture's device for the gyroscope, and a second one for the accelerometer.
class FakeSysfsWithTwo : public FakeSysfs {
 protected:
  FakeSysfsWithTwo() {
    fs::copy(device_, root_ + "/sys/iio:device4", fs::copy_options::recursive);
    std::ofstream(root_ + "/sys/iio:device4/name") << "accel\n";
    EXPECT_EQ(::mkfifo((root_ + "/dev/iio:device4").c_str(), 0600), 0);
    config_.device = "adis16470";
    config_.device_accel = "accel";
    config_.delay_ms = 3;
    gyro_ = ::open((root_ + "/dev/iio:device3").c_str(), O_RDWR | O_NONBLOCK);
    accel_ = ::open((root_ + "/dev/iio:device4").c_str(), O_RDWR | O_NONBLOCK);
    EXPECT_TRUE(gyro_ >= 0 && accel_ >= 0);
  }
  ~FakeSysfsWithTwo() override {
    ::close(gyro_);
    ::close(accel_);
  }
  /// `x` thousandths of a unit about or along the chip's first axis.
  static void write(int fd, int x, std::int64_t stamp_ns) {
    std::array<std::uint8_t, 16> scan{static_cast<std::uint8_t>(x >> 8), static_cast<std::uint8_t>(x)};
    std::memcpy(scan.data() + 8, &stamp_ns, 8);
    ASSERT_EQ(::write(fd, scan.data(), scan.size()), static_cast<ssize_t>(scan.size()));
  }
  /// All that `play(begin_ns)` leads to. A computer that stood still when the first readings came is asked again: they
  /// were too old to be the host's.
  std::vector<ImuSample> read_all(IioImu& imu, std::size_t wanted, const std::function<void(std::int64_t)>& play) {
    for (int attempt = 0; attempt < 20; ++attempt) {
      const Status status = imu.open();
      EXPECT_TRUE(status) << status.error().text();
      begin_ns_ = monotonic_ns() - 200'000'000;
      play(begin_ns_);
      std::vector<ImuSample> all;
      std::array<ImuSample, 8> samples;
      const std::int64_t until_ns = monotonic_ns() + 1'000'000'000;
      while (all.size() < wanted && monotonic_ns() < until_ns) {
        std::size_t count = 0;
        if (imu.read(samples, count, Span::from_milliseconds(10)) == ReadOutcome::kFailed) break;
        all.insert(all.end(), samples.begin(), samples.begin() + static_cast<std::ptrdiff_t>(count));
      }
      if (imu.clock() == IioClock::kHost && all.size() == wanted) return all;
    }
    ADD_FAILURE() << "no " << wanted << " samples";
    return {};
  }

  ImuDeviceConfig config_;
  int gyro_ = -1, accel_ = -1;
  std::int64_t begin_ns_ = 0;
};

// The accelerometer's device gives nothing; the gyroscope's goes on, and its readings have to wait.
TEST_F(FakeSysfsWithTwo, WaitingForTheAccelerometerTakesNoProcessor) {
  IioImu imu(config_, roots());
  const Status status = imu.open();
  ASSERT_TRUE(status) << status.error().text();
  const std::int64_t begin_ns = monotonic_ns() - 100'000'000;
  for (int i = 1; i <= 500; ++i) write(gyro_, 0, begin_ns + 1'000 * i);
  const auto processor_ns = [] {
    timespec t{};
    ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return t.tv_sec * 1'000'000'000LL + t.tv_nsec;
  };
  std::array<ImuSample, 8> samples;
  std::size_t count = 0;
  const std::int64_t before_ns = processor_ns();
  EXPECT_EQ(imu.read(samples, count, Span::from_milliseconds(1'000)), ReadOutcome::kTimeout);
  EXPECT_LT(processor_ns() - before_ns, 50'000'000) << "of a second of waiting";
}

// The accelerometer is 2 ms ahead of the gyroscope, begins 3 ms after it, and is silent for 25 ms.
TEST_F(FakeSysfsWithTwo, TheAccelerometerIsInterpolatedAtTheGyroscopesTimes) {
  constexpr std::int64_t kPeriod = 5'000'000, kAheadBy = 2'000'000;
  IioImu imu(config_, roots());
  const std::vector<ImuSample> samples = read_all(imu, 14, [&](std::int64_t begin_ns) {
    for (int i = 0; i < 20; ++i) write(gyro_, i, begin_ns + i * kPeriod);
    for (int i = 1; i <= 20; ++i)
      if (i <= 11 || i >= 16) write(accel_, 100 * i, begin_ns + i * kPeriod - kAheadBy);
  });
  ASSERT_EQ(samples.size(), 14u);
  std::size_t at = 0;
  for (int i = 1; i < 20; ++i) {
    if (i >= 11 && i < 16) continue;
    const ImuSample& sample = samples[at++];
    EXPECT_EQ(sample.stamp.ns, begin_ns_ + i * kPeriod - 3'000'000) << "the filter's delay";
    EXPECT_DOUBLE_EQ(sample.angular_velocity_rad_s[0], 0.001 * i);
    EXPECT_NEAR(sample.specific_force_m_s2[1], -(0.1 * i + 0.04), 1e-9) << "the board's y is the chip's -x";
    EXPECT_GE(sample.arrival.ns, begin_ns_ + 200'000'000);
  }
  const IioCounts counts = imu.counts();
  EXPECT_EQ(counts.without_accel, 6u) << "one before it began, five in its gap";
  EXPECT_EQ(counts.samples, 14u);
  EXPECT_EQ(counts.lost + counts.disordered + counts.bad_stamps + counts.disconnected, 0u);
}

TEST_F(FakeSysfsWithTwo, ABrokenScanMakesItBeginAnew) {
  IioImu imu(config_, roots());
  const auto play = [&](std::int64_t begin_ns) {
    for (int i = 0; i < 4; ++i) {
      write(accel_, 100, begin_ns + i * 5'000'000);
      write(gyro_, i, begin_ns + i * 5'000'000);
    }
  };
  ASSERT_EQ(read_all(imu, 4, play).size(), 4u);
  const std::uint64_t before = imu.counts().samples;
  ASSERT_EQ(::write(accel_, "broken", 7), 7);
  std::array<ImuSample, 8> samples;
  std::size_t count = 0;
  EXPECT_EQ(imu.read(samples, count, Span{0}), ReadOutcome::kFailed);
  EXPECT_EQ(imu.counts().disconnected, 1u);
  EXPECT_EQ(imu.counts().last_error, EPROTO);
  EXPECT_FALSE(imu.is_streaming());
  // without the device every attempt fails, and is counted
  fs::rename(root_ + "/sys/iio:device4", root_ + "/sys/gone");
  while (imu.counts().retries < 2)
    EXPECT_EQ(imu.read(samples, count, Span::from_milliseconds(100)), ReadOutcome::kFailed);
  fs::rename(root_ + "/sys/gone", root_ + "/sys/iio:device4");
  while (!imu.is_streaming()) imu.read(samples, count, Span::from_milliseconds(100));
  for (int attempt = 0; attempt < 20 && imu.counts().samples == before; ++attempt) {
    play(monotonic_ns() - 20'000'000);
    imu.read(samples, count, Span::from_milliseconds(100));
  }
  EXPECT_GT(imu.counts().samples, before);
  EXPECT_EQ(imu.counts().disconnected, 1u);
}

TEST_F(FakeSysfsWithTwo, SensorsOfTwoHubsAreRefused) {
  IioImu imu(config_, roots());
  const auto move_to = [&](const std::string& device, const std::string& hub) {
    const std::string folder = root_ + "/" + hub + "/HID-SENSOR-200076.1.auto";
    fs::create_directories(folder);
    fs::rename(fs::canonical(root_ + "/sys/" + device), folder + "/" + device);
    fs::remove(root_ + "/sys/" + device);
    fs::create_directory_symlink(folder + "/" + device, root_ + "/sys/" + device);
  };
  move_to("iio:device3", "hub0");
  move_to("iio:device4", "hub1");
  const Status status = imu.open();
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().text(),
            "imu.device_accel accel: the accelerometer belongs to another sensor hub than the gyroscope [two devices]; "
            "expected both sensors of one hub, because they need one clock");
  EXPECT_EQ(get("buffer/enable"), "0");
  move_to("iio:device4", "hub0");
  EXPECT_TRUE(imu.open());
}

}  // namespace
}  // namespace epiline
