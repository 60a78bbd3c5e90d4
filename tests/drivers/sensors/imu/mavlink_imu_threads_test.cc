// Readings of a flight controller over a pseudo terminal, with a clock of its own.
#include "drivers/sensors/imu/mavlink_imu.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <thread>

#include "tests/drivers/links/mavlink/link_peer.h"

namespace epiline::mavlink {
namespace {

constexpr std::int64_t kLong = 30'000;  // ms

/// Answers and sends on a thread of its own, as the other side does. Its clock began lately, and is fast by 50 ppm.
class FlightController {
 public:
  FlightController(Peer& peer, bool knows_highres, std::uint8_t autopilot)
      : peer_(peer), knows_highres_(knows_highres), autopilot_(autopilot) {
    peer_.on_packet = [this](const Packet& packet) { receive(packet); };
    thread_ = std::thread([this] { run(); });
  }
  ~FlightController() {
    stop_ = true;
    thread_.join();
  }
  std::int64_t now_ns() const {
    const auto since = static_cast<double>(monotonic_ns() - start_ns_);
    return 5'000 * kMs + static_cast<std::int64_t>(since * (1 + 50e-6));
  }
  /// Our clock at that instant of its clock.
  std::int64_t host_ns(std::int64_t device_ns) const {
    return start_ns_ + static_cast<std::int64_t>(static_cast<double>(device_ns - 5'000 * kMs) / (1 + 50e-6));
  }
  std::atomic<int> requests{0};

 private:
  void receive(const Packet& packet) {
    Timesync question;
    CommandLong command;
    if (unpack(packet, question) && question.tc1 == 0) peer_.send(Timesync{.tc1 = now_ns(), .ts1 = question.ts1});
    if (!unpack(packet, command) || command.command != 511) return;
    ++requests;
    const bool is_known = command.param1 == 27 || knows_highres_;
    if (is_known) message_ = static_cast<int>(command.param1);
    peer_.send(CommandAck{.command = 511, .result = static_cast<std::uint8_t>(is_known ? 0 : 3)});
  }
  void run() {
    for (int i = 0; !stop_; ++i) {
      if (i % 100 == 0) peer_.send(Heartbeat{.type = 2, .autopilot = autopilot_});
      const auto time_us = static_cast<std::uint64_t>(now_ns() / 1000);
      if (message_ == 105) peer_.send(HighresImu{.time_usec = time_us, .zacc = -9.8F, .fields_updated = 0x3f});
      if (message_ == 27) peer_.send(RawImu{.time_usec = time_us, .zacc = -1000});
      peer_.read();
      ::usleep(5000);
    }
  }

  Peer& peer_;
  bool knows_highres_;
  std::uint8_t autopilot_;
  const std::int64_t start_ns_ = monotonic_ns();
  int message_ = 0;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

const ImuDeviceConfig kImu = [] {
  ImuDeviceConfig imu;
  imu.driver = static_cast<int>(ImuDriver::kMavlink);
  return imu;
}();

void expect_readings(bool knows_highres, std::uint8_t autopilot) {
  PseudoTerminal line;
  MavlinkLink link(serial_config(line.path()), Mat3::Identity(), kImu);
  Status status = link.open();
  ASSERT_TRUE(status) << status.error().text();
  FlightController controller(line.peer, knows_highres, autopilot);
  MavlinkImu imu(link);
  status = imu.open();
  ASSERT_TRUE(status) << status.error().text();
  std::array<ImuSample, 16> samples;
  HostStamp last;
  for (int taken = 0; taken < 200;) {
    std::size_t count = 0;
    ASSERT_EQ(imu.read(samples, count, Span::from_milliseconds(kLong)), ReadOutcome::kSample);
    for (std::size_t i = 0; i < count; ++i, ++taken) {
      EXPECT_GT(samples[i].stamp, last);
      last = samples[i].stamp;
      EXPECT_NEAR(samples[i].specific_force_m_s2[2], 9.8, 0.01);
      EXPECT_LE(std::abs((samples[i].arrival - samples[i].stamp).ns), 500 * kMs);
    }
  }
  const ClockState clock = imu.clock_state();
  // what the model makes of the flight controller's clock, against what it is; the bound is the link's own
  const std::int64_t device_ns = controller.now_ns();
  EXPECT_LE(std::abs(device_ns + clock.offset.ns - controller.host_ns(device_ns)), clock.bound.ns + 2 * kMs);
  EXPECT_GE(clock.used, 10U);
  EXPECT_EQ(imu.counts().refused_values, 0U);
}

TEST(MavlinkImu, TakesHighresImu) { expect_readings(true, 12); }
TEST(MavlinkImu, TakesRawImuOfAnArduPilot) { expect_readings(false, 3); }

TEST(MavlinkImu, FailsWhileTheLineIsLost) {
  PseudoTerminal line;
  MavlinkLink link(serial_config(line.path()), Mat3::Identity(), kImu);
  ASSERT_TRUE(link.open());
  MavlinkImu imu(link);
  std::array<ImuSample, 4> samples;
  std::size_t count = 1;
  EXPECT_EQ(imu.read(samples, count, Span::from_milliseconds(20)), ReadOutcome::kTimeout);
  EXPECT_EQ(count, 0U);
  line.unplug();
  ASSERT_TRUE(wait_for(line.peer, kLong, [&] { return !link.state().is_open; }));
  EXPECT_EQ(imu.read(samples, count, Span::from_milliseconds(20)), ReadOutcome::kFailed);
}

}  // namespace
}  // namespace epiline::mavlink
