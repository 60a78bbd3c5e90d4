// A live flight on kernel drivers, from an ordinary configuration file, while its devices are unplugged: what comes
// back, how soon, and what is said meanwhile.
#include "drivers/live/live_run.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <stdlib.h>
#include <unistd.h>

#include <atomic>
#include <cstdio>
#include <fstream>
#include <random>
#include <thread>

#include "drivers/hil/uhid_imu.h"
#include "drivers/output/mavlink/packet.h"
#include "tests/hardware/camera_support.h"

namespace epiline {
namespace {

/// An IMU at rest that the kernel takes for a real one.
class RestingImu {
 public:
  ~RestingImu() {
    ends_ = true;
    if (thread_.joinable()) thread_.join();
  }
  UhidImu& hub() { return hub_; }
  void start() {
    thread_ = std::thread([this] {
      std::minstd_rand random;
      std::normal_distribution<double> noise;
      for (std::int64_t next_ns = monotonic_ns(); !ends_; next_ns += 10'000'000) {
        const std::int64_t wait_ns = next_ns - monotonic_ns();
        if (wait_ns > 0) std::this_thread::sleep_for(std::chrono::nanoseconds(wait_ns));
        const DeviceStamp now{monotonic_ns() + 5'000'000'000};  // a clock of its own
        const auto n = [&](double sigma) { return sigma * noise(random); };
        hub_.send_accelerometer(now, {n(0.02), n(0.02), 9.81 + n(0.02)});
        hub_.send_gyroscope(now, {n(2e-3), n(2e-3), n(2e-3)});
      }
    });
  }

 private:
  UhidImu hub_;
  std::atomic<bool> ends_{false};
  std::thread thread_;
};

/// The other end of the serial line: counts odometry.
class Listener {
 public:
  Listener() : fd_(::posix_openpt(O_RDWR | O_NOCTTY)) {
    EXPECT_TRUE(fd_ >= 0 && ::grantpt(fd_) == 0 && ::unlockpt(fd_) == 0);
    thread_ = std::thread([this] { listen(); });
  }
  ~Listener() {
    ends_ = true;
    thread_.join();
    ::close(fd_);
  }
  std::string path() const { return ::ptsname(fd_); }
  int odometry() const { return odometry_; }

 private:
  void listen() {
    ::fcntl(fd_, F_SETFL, O_NONBLOCK);
    mavlink::Parser parser;
    std::uint8_t bytes[4096];
    while (!ends_) {
      const ssize_t n = ::read(fd_, bytes, sizeof bytes);
      if (n <= 0) {
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
        continue;
      }
      std::span<const std::uint8_t> left(bytes, static_cast<std::size_t>(n));
      while (const mavlink::Packet* const packet = parser.next(left)) odometry_ += packet->id == mavlink::Odometry::kId;
    }
  }
  int fd_;
  std::atomic<bool> ends_{false};
  std::atomic<int> odometry_{0};
  std::thread thread_;
};

void write_file(const std::filesystem::path& path, const std::string& text) { std::ofstream(path) << text; }

TEST(LiveFlight, CameraAndImuAreUnpluggedUnderIt) {
  const auto folder = std::filesystem::temp_directory_path() / "epiline_live";
  std::filesystem::create_directories(folder);
  RestingImu imu;
  const Status plugged = imu.hub().plug_in();
  ASSERT_TRUE(plugged) << plugged.error().text();
  imu.start();
  Listener listener;
  set_controls("/dev/video0", {{"test_pattern", 10}});  // a chessboard
  write_file(folder / "camera.yaml",
             "T_BS:\n  data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\nresolution: [320, 180]\n"
             "camera_model: pinhole\nintrinsics: [250, 250, 160, 90]\ndistortion_model: none\n"
             "distortion_coefficients: []\n");
  write_file(folder / "flight.toml", "[camera]\ndevice = \"/dev/video0\"\nrate_hz = 10\ncalibration = \"" +
                                         (folder / "camera.yaml").string() +
                                         "\"\n[imu]\ndevice = \"gyro_3d\"\ndevice_accel = \"accel_3d\"\nrate_hz = 100\n"
                                         "gyroscope_noise_density = 1e-3\naccelerometer_noise_density = 1e-2\n"
                                         "[realtime]\ndeadline_ms = 0\nimu_wait_ms = 2000\n[mavlink]\nserial = \"" +
                                         listener.path() + "\"\n");
  const auto settings = read_live_settings(folder / "flight.toml");
  ASSERT_TRUE(settings) << settings.error().text();
  auto devices = make_devices(*settings);
  ASSERT_TRUE(devices) << devices.error().text();

  enum { kStarting, kNoCamera, kCameraBack, kNoImu, kImuBack, kOver } phase = kStarting;
  std::int64_t phase_ns = monotonic_ns();
  std::uint64_t images = 0, readings = 0;
  int sent = 0, sent_while_lost = 0;
  HostStamp lost_at;
  bool told_camera = false, told_imu = false, device_back = false;
  const auto enter = [&](auto next, const LiveState& state) {
    phase = next;
    phase_ns = monotonic_ns();
    images = state.images;
    readings = state.readings;
    sent = listener.odometry();
    device_back = false;
  };
  const auto since_s = [&] { return 1e-9 * static_cast<double>(monotonic_ns() - phase_ns); };
  const auto is_well = [&](const LiveState& state) {
    const HealthState s = state.odometry.health.state;
    return state.has_pose && state.odometry.stamp > lost_at &&
           (s == HealthState::kTracking || s == HealthState::kDegraded) && listener.odometry() > sent;
  };
  const auto comes_back = [&](bool is_back, const char* what) {
    if (!device_back && is_back) {
      std::printf("%s: first after %.2f s\n", what, since_s());
      device_back = true;
    }
    return device_back;
  };
  LiveOptions options;
  options.out = folder / "out";
  const auto record = fly(*settings, *devices, options, [&](const LiveState& state) {
    const std::uint32_t reasons = state.odometry.health.reasons;
    switch (phase) {
      case kStarting:
        if (!is_well(state) || since_s() < 5) break;
        write_file("/sys/bus/platform/drivers/vivid/unbind", "vivid.0");
        enter(kNoCamera, state);
        break;
      case kNoCamera:
        told_camera |= (reasons & bit(HealthReason::kCameraSilent)) != 0;
        if (state.odometry.health.state != HealthState::kLost) sent = listener.odometry();
        if (!told_camera || since_s() < 4) break;
        sent_while_lost = listener.odometry() - sent;
        lost_at = HostStamp{monotonic_ns()};
        write_file("/sys/bus/platform/drivers/vivid/bind", "vivid.0");
        enter(kCameraBack, state);
        break;
      case kCameraBack:
        if (!comes_back(state.images > images, "camera") || !is_well(state)) break;
        std::printf("camera: odometry after %.2f s\n", since_s());
        imu.hub().unplug();
        enter(kNoImu, state);
        break;
      case kNoImu:
        told_imu |= (reasons & bit(HealthReason::kImuSilent)) != 0;
        if (!told_imu || since_s() < 2) break;
        lost_at = HostStamp{monotonic_ns()};
        EXPECT_TRUE(imu.hub().plug_in());
        enter(kImuBack, state);
        break;
      case kImuBack:
        if (!comes_back(state.readings > readings, "imu") || !is_well(state)) break;
        std::printf("imu: odometry after %.2f s\n", since_s());
        phase = kOver;
        break;
      case kOver:
        break;
    }
    return phase != kOver && state.since_start.seconds() < 120;
  });
  ASSERT_TRUE(record) << record.error().text();
  EXPECT_EQ(phase, kOver)
      << "0: no start, 1: camera's silence not told, 2: not back, 3: IMU's silence not told, 4: not back";
  EXPECT_TRUE(told_camera);
  EXPECT_TRUE(told_imu);
  EXPECT_LE(sent_while_lost, 1) << "one may be on its way";
  std::ifstream events(options.out / "events.txt");
  for (std::string line; std::getline(events, line);) std::printf("  %s\n", line.c_str());
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace epiline
