// A live flight on kernel drivers, from an ordinary configuration file, while its devices are unplugged: what comes
// back, how soon, and what is said meanwhile.
#include "drivers/program/live/live_run.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <stdlib.h>
#include <unistd.h>

#include <atomic>
#include <cstdio>
#include <fstream>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "drivers/links/mavlink/packet.h"
#include "tests/hardware/camera_support.h"
#include "tests/hardware/resting_imu.h"
#include "tests/hardware/usb_serial_support.h"

namespace epiline {
namespace {

/// The other end of the serial line: counts odometry.
class Listener {
 public:
  /// Closes the file in the end.
  explicit Listener(int fd) : fd_(fd) {
    thread_ = std::thread([this] { listen(); });
  }
  ~Listener() {
    ends_ = true;
    thread_.join();
    ::close(fd_);
    if (const int unused = next_fd_; unused >= 0) ::close(unused);
  }
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  /// Goes on with another file.
  void take(int fd) { next_fd_ = fd; }
  int odometry() const { return odometry_; }

 private:
  void listen() {
    mavlink::Parser parser;
    std::uint8_t bytes[4096];
    ::fcntl(fd_, F_SETFL, O_NONBLOCK);
    while (!ends_) {
      if (const int next = next_fd_.exchange(-1); next >= 0) {
        ::close(fd_);
        fd_ = next;
      }
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
  std::atomic<int> next_fd_{-1}, odometry_{0};
  std::atomic<bool> ends_{false};
  std::thread thread_;
};

bool has(const LiveState& state, HealthReason reason) { return (state.odometry.health.reasons & bit(reason)) != 0; }
bool is_flying(const LiveState& state) {
  const HealthState s = state.odometry.health.state;
  return state.has_pose && (s == HealthState::kTracking || s == HealthState::kDegraded);
}

/// vivid's chessboard, an IMU at rest, and somebody at the end of the line.
class LiveFlight : public testing::Test {
 protected:
  /// Something that has to be seen, and what is done then.
  struct Act {
    const char* awaited;
    std::function<bool(const LiveState&)> is_seen;
    std::function<void()> then = {};  ///< empty: the next goes on from the same instant
  };

  void SetUp() override {
    std::filesystem::create_directories(folder_);
    const Status plugged = imu_.hub().plug_in();
    ASSERT_TRUE(plugged) << plugged.error().text();
    imu_.start();
    set_controls("/dev/video0", {{"test_pattern", 10}});
    write_file(folder_ / "camera.yaml", plain_camera(320, 180));
  }
  void TearDown() override {
    std::filesystem::remove_all(folder_);
    find_number_again();
  }

  /// The acts one after the other, in a flight with that line.
  void fly_through(const std::string& serial, const std::vector<Act>& acts) {
    write_file(folder_ / "flight.toml",
               "[camera]\ndevice = \"/dev/video0\"\nrate_hz = 10\ncalibration = \"" +
                   (folder_ / "camera.yaml").string() +
                   "\"\n[imu]\ndevice = \"gyro_3d\"\ndevice_accel = \"accel_3d\"\nrate_hz = 100\n"
                   "gyroscope_noise_density = 1e-3\naccelerometer_noise_density = 1e-2\n"
                   "[realtime]\ndeadline_ms = 0\nimu_wait_ms = 2000\n[mavlink]\nserial = \"" +
                   serial + "\"\n");
    const auto settings = read_live_settings(folder_ / "flight.toml");
    ASSERT_TRUE(settings) << settings.error().text();
    auto devices = make_devices(*settings);
    ASSERT_TRUE(devices) << devices.error().text();
    LiveOptions options;
    options.out = folder_ / "out";
    std::size_t act = 0;
    begin_act({});
    const auto record = fly(*settings, *devices, options, [&](const LiveState& state) {
      if (acts[act].is_seen(state)) {
        std::printf("%s: after %.2f s\n", acts[act].awaited, since_s());
        if (const auto& then = acts[act++].then) {
          then();
          begin_act(state);
        }
      }
      return act < acts.size() && state.since_start.seconds() < 120;
    });
    ASSERT_TRUE(record) << record.error().text();
    EXPECT_EQ(act, acts.size()) << "not seen: " << acts[std::min(act, acts.size() - 1)].awaited;
    std::ifstream events(options.out / "events.txt");
    for (std::string line; std::getline(events, line);) std::printf("  %s\n", line.c_str());
  }
  static void plug_camera(const char* how) {
    write_file(std::string("/sys/bus/platform/drivers/vivid/") + how, "vivid.0");
  }
  /// A camera that was unplugged while its images were in use comes back under another number; others look for the
  /// first.
  static void find_number_again() {
    for (int i = 0; i < 10 && !std::filesystem::exists("/dev/video0"); ++i) {
      plug_camera("unbind");
      plug_camera("bind");
      std::this_thread::sleep_for(std::chrono::seconds(1));
    }
  }
  void begin_act(const LiveState& state) {
    began_at_ = HostStamp{monotonic_ns()};
    images_ = state.images;
    readings_ = state.readings;
    sent_ = listener_->odometry();
  }
  // Since the act began: when something was unplugged, say.
  double since_s() const { return 1e-9 * static_cast<double>(monotonic_ns() - began_at_.ns); }
  int sent() const { return listener_->odometry() - sent_; }
  /// Odometry of now is estimated, and arrives.
  bool is_well(const LiveState& state) const {
    return is_flying(state) && state.odometry.stamp > began_at_ && sent() > 0;
  }

  const std::filesystem::path folder_ = std::filesystem::temp_directory_path() / "epiline_live";
  RestingImu imu_;
  std::unique_ptr<Listener> listener_;
  HostStamp began_at_;
  std::uint64_t images_ = 0, readings_ = 0;
  int sent_ = 0;
};

TEST_F(LiveFlight, CameraAndImuAreUnpluggedUnderIt) {
  const int pty = ::posix_openpt(O_RDWR | O_NOCTTY);
  ASSERT_TRUE(pty >= 0 && ::grantpt(pty) == 0 && ::unlockpt(pty) == 0);
  listener_ = std::make_unique<Listener>(pty);
  bool told = false, lost_seen = false;
  int sent_while_lost = 0;
  // Told, lost for a while, and silent since.
  const auto is_lost = [&](const LiveState& state, HealthReason reason, double seconds) {
    told |= has(state, reason);
    if (!lost_seen) sent_ = listener_->odometry();  // what came before the first look that finds it lost is no fault
    lost_seen = state.odometry.health.state == HealthState::kLost;
    return told && since_s() > seconds;
  };
  fly_through(
      ::ptsname(pty),
      {{"flies", [&](const LiveState& s) { return is_well(s) && since_s() > 5; }, [&] { plug_camera("unbind"); }},
       {"camera lost", [&](const LiveState& s) { return is_lost(s, HealthReason::kCameraSilent, 4); },
        [&] {
          sent_while_lost = sent();
          plug_camera("bind");
        }},
       {"camera back, image", [&](const LiveState& s) { return s.images > images_; }},
       {"odometry", [&](const LiveState& s) { return is_well(s); },
        [&] {
          told = lost_seen = false;
          imu_.hub().unplug();
        }},
       {"IMU lost", [&](const LiveState& s) { return is_lost(s, HealthReason::kImuSilent, 2); },
        [&] { EXPECT_TRUE(imu_.hub().plug_in()); }},
       {"IMU back, reading", [&](const LiveState& s) { return s.readings > readings_; }},
       {"odometry", [&](const LiveState& s) { return is_well(s); }}});
  EXPECT_LE(sent_while_lost, 1) << "one may be on its way";
}

TEST_F(LiveFlight, SerialLineIsUnpluggedUnderIt) {
  if (!SerialGadget::can_be_had()) GTEST_SKIP() << "no USB gadgets in this kernel";
  SerialGadget gadget;
  gadget.plug_in();
  listener_ = std::make_unique<Listener>(SerialGadget::open_their_end());
  const std::string lost = std::string("mavlink ") + SerialGadget::kOurs;
  double back_after_s = 0;
  // The sensors are well, and nobody says anything else.
  const auto flies_without_line = [&](const LiveState& s) {
    return s.lost_outputs == lost && is_flying(s) && s.odometry.stamp > began_at_ &&
           !has(s, HealthReason::kCameraSilent) && !has(s, HealthReason::kImuSilent);
  };
  fly_through(SerialGadget::kOurs,
              {{"flies", [&](const LiveState& s) { return is_well(s) && s.lost_outputs.empty() && since_s() > 5; },
                [&] { gadget.unplug(); }},
               {"line lost", [&](const LiveState& s) { return s.lost_outputs == lost; }},
               {"flies without it", [&](const LiveState& s) { return flies_without_line(s) && since_s() > 3; },
                [&] {
                  gadget.plug_in();  // under the same name, for the link has let go of it
                  listener_->take(SerialGadget::open_their_end());
                }},
               {"line back, odometry", [&](const LiveState& s) { return is_well(s) && s.lost_outputs.empty(); },
                [&] { back_after_s = since_s(); }}});
  EXPECT_LE(back_after_s, 2);
  listener_.reset();  // lets go of the line before the gadget does
}

}  // namespace
}  // namespace epiline
