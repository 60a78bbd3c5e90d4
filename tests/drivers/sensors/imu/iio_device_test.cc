// What the kernel's HID sensors do not have: big-endian scans, offsets, mount matrices, both sensors in one device,
// rates that are refused. On a folder that looks like sysfs; tests/hardware has the kernel itself.
#include "drivers/sensors/imu/iio_device.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "drivers/sensors/imu/iio_imu.h"
#include "platform/time/monotonic.h"

namespace epiline {
namespace {

namespace fs = std::filesystem;

/// A device with both sensors: 16 bits, big-endian, y of the gyroscope shifted.
class FakeSysfs : public testing::Test {
 protected:
  FakeSysfs() {
    fs::remove_all(root_);
    fs::create_directories(device_ + "/buffer");
    fs::create_directories(device_ + "/scan_elements");
    fs::create_directories(root_ + "/dev");
    EXPECT_EQ(::mkfifo((root_ + "/dev/iio:device3").c_str(), 0600), 0);
    put("name", "adis16470\n");
    put("sampling_frequency", "200.000000\n");
    put("current_timestamp_clock", "realtime\n");
    put("buffer/enable", "0\n"), put("buffer/length", "2\n"), put("buffer/watermark", "1\n");
    int index = 0;
    for (const char* type : {"anglvel", "accel"}) {
      put("in_" + std::string(type) + "_scale", "0.001\n");
      for (const char* axis : {"x", "y", "z"}) element("in_" + std::string(type) + "_" + axis, index++, "be:s16/16>>0");
    }
    put("scan_elements/in_anglvel_y_type", "be:u12/16>>4\n");
    put("in_anglvel_y_offset", "-2048\n");
    put("in_accel_y_scale", "0.002\n");
    put("in_accel_mount_matrix", "0, 1, 0; -1, 0, 0; 0, 0, 1\n");
    element("in_temp0", 6, "be:s16/16>>0");
    put("scan_elements/in_temp0_en", "1\n");
    element("in_timestamp", 7, "le:s64/64>>0");
  }
  ~FakeSysfs() override { fs::remove_all(root_); }

  void put(const std::string& name, const std::string& text) { std::ofstream(device_ + "/" + name) << text; }
  void element(const std::string& name, int index, const std::string& type) {
    put("scan_elements/" + name + "_en", "0\n");
    put("scan_elements/" + name + "_index", std::to_string(index) + "\n");
    put("scan_elements/" + name + "_type", type + "\n");
  }
  std::string get(const std::string& name) {
    std::string line;
    std::ifstream file(device_ + "/" + name);
    std::getline(file, line);
    return line;
  }
  std::string trouble_of(const IioRequest& request) {
    IioDevice device;
    const DeviceTrouble trouble = device.open(roots(), request);
    return trouble ? error_of(trouble, "it").text() : "opened";
  }
  IioRoots roots() const { return {root_names_[0].c_str(), root_names_[1].c_str()}; }

  const std::string root_ = testing::TempDir() + "iio-" + std::to_string(::getpid());
  const std::string device_ = root_ + "/sys/iio:device3";
  const std::array<std::string, 2> root_names_{root_ + "/sys", root_ + "/dev"};
  const IioRequest request_{"adis16470", true, true, 200, ""};
};

TEST_F(FakeSysfs, ValuesAreCountPlusOffsetTimesScaleInTheBoardsAxes) {
  IioDevice device;
  const DeviceTrouble trouble = device.open(roots(), request_);
  ASSERT_FALSE(trouble) << error_of(trouble, "it").text();
  EXPECT_EQ(device.rate_hz(), 200);
  EXPECT_EQ(get("buffer/enable"), "1");
  EXPECT_EQ(get("buffer/length"), "100");
  EXPECT_EQ(get("current_timestamp_clock"), "monotonic");
  EXPECT_EQ(get("scan_elements/in_temp0_en"), "0") << "nobody wants it";
  std::array<IioReading, 8> readings;
  std::size_t count = 1;
  const int writer = ::open((root_ + "/dev/iio:device3").c_str(), O_WRONLY | O_NONBLOCK);
  ASSERT_GE(writer, 0);
  EXPECT_EQ(device.read(readings, count), EAGAIN);
  EXPECT_EQ(count, 0u);
  // gyroscope 1000, 0x801 -> 2049 - 2048, -1; accelerometer 1, 2, 3; padding; time
  const std::vector<std::uint8_t> scan{0x03, 0xE8, 0x80, 0x1F, 0xFF, 0xFF, 0,    1,    0, 2, 0, 3,
                                       9,    9,    9,    9,    0x00, 0xCA, 0x9A, 0x3B, 0, 0, 0, 0};
  ASSERT_EQ(::write(writer, scan.data(), scan.size()), static_cast<ssize_t>(scan.size()));
  ASSERT_EQ(::write(writer, scan.data(), scan.size()), static_cast<ssize_t>(scan.size()));
  ASSERT_EQ(device.read(readings, count), 0);
  ASSERT_EQ(count, 2u);
  EXPECT_EQ(readings[1].stamp_ns, 1'000'000'000);
  EXPECT_EQ(readings[1].angular_velocity_rad_s, (std::array<double, 3>{1.0, 0.001, -0.001}));
  EXPECT_EQ(readings[1].specific_force_m_s2, (std::array<double, 3>{0.004, -0.001, 0.003}));
  ASSERT_EQ(::write(writer, scan.data(), 7), 7) << "no kernel does that";
  EXPECT_EQ(device.read(readings, count), EPROTO);
  ::close(writer);
  device.close();
  EXPECT_EQ(get("buffer/enable"), "0");
  EXPECT_EQ(get("buffer/length"), "2");
  EXPECT_EQ(get("scan_elements/in_temp0_en"), "1");
  EXPECT_EQ(get("scan_elements/in_accel_x_en"), "0");
  EXPECT_EQ(get("current_timestamp_clock"), "realtime");
}

TEST_F(FakeSysfs, OnlyTheSensorAskedForIsSwitchedOn) {
  IioRequest request = request_;
  request.accelerometer = false;
  IioDevice device;
  ASSERT_FALSE(device.open(roots(), request));
  EXPECT_EQ(get("scan_elements/in_anglvel_z_en"), "1");
  EXPECT_EQ(get("scan_elements/in_accel_z_en"), "0");
}

TEST_F(FakeSysfs, FastSensorsWakeUsForSeveralReadings) {
  put("sampling_frequency", "2000.000000\n");
  IioRequest request = request_;
  request.rate_hz = 2'000;
  IioDevice device;
  ASSERT_FALSE(device.open(roots(), request));
  EXPECT_EQ(get("buffer/watermark"), "4");
  EXPECT_EQ(get("buffer/length"), "1000");
  put("buffer/hwfifo_watermark_min", "8\n");
  device.close();
  ASSERT_FALSE(device.open(roots(), request));
  EXPECT_EQ(get("buffer/watermark"), "8");
}

TEST_F(FakeSysfs, TheRateIsSetWhereItIs) {
  fs::remove(device_ + "/sampling_frequency");
  put("in_anglvel_sampling_frequency", "100\n");
  put("in_accel_sampling_frequency", "50\n");
  IioDevice device;
  ASSERT_FALSE(device.open(roots(), request_));
  EXPECT_EQ(get("in_anglvel_sampling_frequency"), "200");
  EXPECT_EQ(get("in_accel_sampling_frequency"), "200");
  device.close();
  fs::remove(device_ + "/in_anglvel_sampling_frequency");
  fs::remove(device_ + "/in_accel_sampling_frequency");
  fs::create_directories(device_ + "/trigger");
  fs::create_directories(root_names_[0] + "/trigger0");
  put("trigger/current_trigger", "\n");
  put("../trigger0/name", "adis16470-dev3\n");
  put("../trigger0/sampling_frequency", "100\n");
  ASSERT_FALSE(device.open(roots(), request_));
  EXPECT_EQ(get("trigger/current_trigger"), "adis16470-dev3");
  EXPECT_EQ(get("../trigger0/sampling_frequency"), "200");
  device.close();
  EXPECT_EQ(get("../trigger0/sampling_frequency"), "100");
}

TEST_F(FakeSysfs, SaysWhatIsWrong) {
  IioRequest request = request_;
  request.device = "bmi160";
  EXPECT_EQ(trouble_of(request), "it: no IIO device is called 'bmi160' [open]; expected one of adis16470");
  put("scan_elements/in_accel_y_type", "le:s16/16\n");
  EXPECT_EQ(trouble_of(request_), "it: in_accel_y_en: le:s16/16 [layout of a scan]; expected a type like le:s16/16>>0");
  put("scan_elements/in_accel_y_type", "be:s16/16>>0\n");
  put("in_accel_mount_matrix", "1, 0, 0; 0, 1, 0; 0, 0, 0\n");
  EXPECT_EQ(
      trouble_of(request_),
      "it: in_accel_mount_matrix: 1, 0, 0; 0, 1, 0; 0, 0, 0 [mount matrix]; expected a rotation: 1, 0, 0; 0, 1, 0; "
      "0, 0, 1");
  fs::remove(device_ + "/in_accel_mount_matrix");
  put("in_anglvel_scale", "nan\n");
  EXPECT_EQ(trouble_of(request_), "it: in_anglvel_scale has no number [scale]; expected a number");
  fs::remove(device_ + "/scan_elements/in_anglvel_x_en");
  EXPECT_EQ(trouble_of(request_), "it: adis16470 has no gyroscope [channels]; expected a gyroscope in imu.device");
  fs::create_directories(root_names_[0] + "/iio:device11");
  put("../iio:device11/name", "adis16470\n");
  EXPECT_NE(trouble_of(request_).find("2 devices are called 'adis16470' [open]; expected iio:device"),
            std::string::npos);
  EXPECT_EQ(get("buffer/enable"), "0");
}

TEST_F(FakeSysfs, APathNamesTheDeviceToo) {
  fs::create_symlink(root_ + "/dev/iio:device3", root_ + "/dev/imu");
  IioRequest request = request_;
  const std::string link = root_ + "/dev/imu", missing = root_ + "/dev/missing", other = root_ + "/dev/sound";
  request.device = link.c_str();
  EXPECT_EQ(trouble_of(request), "opened");
  request.device = missing.c_str();
  EXPECT_EQ(trouble_of(request).rfind("it: No such file or directory [open]; expected ", 0), 0u) << trouble_of(request);
  std::ofstream(other) << "";
  request.device = other.c_str();
  EXPECT_EQ(trouble_of(request), "it: " + other + " is not an IIO device [open]; expected an IIO device");
}

TEST_F(FakeSysfs, SaysWhatIsMissing) {
  IioRequest request = request_;
  request.trigger = "sync";
  EXPECT_EQ(trouble_of(request), "it: adis16470 has no trigger [trigger]; expected imu.trigger not to be set");
  fs::create_directories(device_ + "/trigger");
  put("trigger/current_trigger", "\n");
  fs::create_directories(root_names_[0] + "/trigger0");
  put("../trigger0/name", "adis16470-dev3\n");
  EXPECT_EQ(trouble_of(request), "it: no trigger is called 'sync' [trigger]; expected one of adis16470-dev3");
  fs::remove(device_ + "/scan_elements/in_timestamp_en");
  EXPECT_EQ(trouble_of(request_).rfind("it: No such file or directory [scan_elements/in_timestamp_en]", 0), 0u);
  put("scan_elements/in_timestamp_en", "0\n");
  fs::remove(device_ + "/buffer/length");
  EXPECT_EQ(trouble_of(request_).rfind("it: No such file or directory [buffer/length]", 0), 0u);
  fs::remove(root_ + "/dev/iio:device3");
  EXPECT_EQ(trouble_of(request_).rfind("it: No such file or directory [open]", 0), 0u);
  fs::remove_all(root_names_[0]);
  EXPECT_EQ(trouble_of(request_), "it: there are no IIO devices [open]; expected an IMU whose kernel driver is loaded");
  fs::create_directories(root_names_[0]);
  EXPECT_EQ(trouble_of(request_),
            "it: no IIO device is called 'adis16470' [open]; expected an IMU whose kernel driver is loaded");
}

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

// The accelerometer's device gives nothing; the gyroscope's goes on, and its readings have to wait.
TEST_F(FakeSysfs, WaitingForTheAccelerometerTakesNoProcessor) {
  fs::copy(device_, root_ + "/sys/iio:device4", fs::copy_options::recursive);
  std::ofstream(root_ + "/sys/iio:device4/name") << "accel\n";
  ASSERT_EQ(::mkfifo((root_ + "/dev/iio:device4").c_str(), 0600), 0);
  ImuDeviceConfig config;
  config.device = "adis16470";
  config.device_accel = "accel";
  IioImu imu(config, roots());
  const Status status = imu.open();
  ASSERT_TRUE(status) << status.error().text();
  const int gyro = ::open((root_ + "/dev/iio:device3").c_str(), O_RDWR | O_NONBLOCK);
  const int accel = ::open((root_ + "/dev/iio:device4").c_str(), O_RDWR | O_NONBLOCK);
  ASSERT_TRUE(gyro >= 0 && accel >= 0);
  std::int64_t stamp_ns = monotonic_ns() - 100'000'000;
  for (int i = 0; i < 500; ++i) {
    std::array<std::uint8_t, 16> scan{};
    stamp_ns += 1'000;
    std::memcpy(scan.data() + 8, &stamp_ns, 8);
    ASSERT_EQ(::write(gyro, scan.data(), scan.size()), static_cast<ssize_t>(scan.size()));
  }
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
  ::close(gyro);
  ::close(accel);
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

TEST(IioMountMatrix, IsARotationOrNothing) {
  std::array<double, 9> m{};
  EXPECT_TRUE(parse_mount_matrix("1, 0, 0; 0, 1, 0; 0, 0, 1", m));
  EXPECT_TRUE(parse_mount_matrix("0.707, 0.707, 0; -0.707, 0.707, 0; 0, 0, 1", m));
  EXPECT_EQ(m[3], -0.707);
  for (const char* wrong : {"", "1", "1, 0, 0; 0, 1, 0; 0, 0", "1, 0, 0; 0, 1, 0; 0, 0, 1;", "1 0 0 0 1 0 0 0 1",
                            "1, 0, 0; 0, 1, 0; 0, 1, 0", "inf, 0, 0; 0, 1, 0; 0, 0, 1", "nan, 0, 0; 0, 1, 0; 0, 0, 1"})
    EXPECT_FALSE(parse_mount_matrix(wrong, m)) << wrong;
}

TEST(IntervalTracker, CountsWhatIsMissingAndFollowsANewRate) {
  IntervalTracker interval(5e6);
  EXPECT_EQ(interval.note(5'100'000), 0u);
  EXPECT_EQ(interval.note(9'900'000), 1u);
  EXPECT_EQ(interval.note(40'000'000), 7u);
  for (int i = 0; i < 100; ++i) interval.note(i % 3 == 0 ? 10'000'000 : 5'000'000);
  EXPECT_NEAR(interval.usual_ns(), 5e6, 0.15e6) << "a third of them missing";
  for (int i = 0; i < 16; ++i) interval.note(50'000'000);
  EXPECT_EQ(interval.note(52'000'000), 0u) << "another rate";
}

}  // namespace
}  // namespace epiline
