// Odometry on a vcan of the kernel. Frames are read by the DBC file alone.
#include <cmath>
#include <map>

#include "drivers/links/can/can_output.h"
#include "drivers/links/can/dbc.h"
#include "platform/memory/allocation_count.h"
#include "tests/drivers/links/can/dbc_reader.h"
#include "tests/hardware/can_support.h"

namespace epiline {
namespace {

constexpr int kBase = 0x300;
const std::map<int, dbc::MessageText>& dbc_file() {
  static const auto file = dbc::read(can::dbc_text(kBase));
  return file;
}

bool is_ours(const Seen& seen) { return dbc_file().count(static_cast<int>(seen.frame.can_id)) != 0; }
dbc::Reading read(const Seen& seen, const std::string& signal) {
  const auto& message = dbc_file().at(static_cast<int>(seen.frame.can_id));
  EXPECT_EQ(seen.fd, message.fd);
  EXPECT_EQ(seen.frame.len, message.size);
  return dbc::read(message.signals.at(signal), {seen.frame.data, seen.frame.len});
}

/// Numbers that follow from the stamp, so that a reader can tell what must have been said.
double position_at(std::int64_t stamp_us) { return static_cast<double>(stamp_us % 1'000'000) * 1e-3; }
double velocity_at(std::int64_t stamp_us) { return static_cast<double>(stamp_us % 10'000'000) * 2e-6 - 10; }

/// A flight that hands odometry out, 200 times a second, until destroyed.
class Flight {
 public:
  explicit Flight(CanOutput& output) : again_(200, [this, &output](std::int64_t) { publish(output); }) {}
  std::uint64_t heap_calls() const { return heap_calls_.load(); }

 private:
  void publish(CanOutput& output) {
    Odometry o;
    const std::int64_t stamp_us = monotonic_ns() / 1000;
    o.stamp.ns = stamp_us * 1000;
    o.p_WB_m = {position_at(stamp_us), -position_at(stamp_us), 1};
    o.v_WB_m_s = {velocity_at(stamp_us), 0, 0};
    o.health = {HealthState::kTracking, 0, 90};
    for (std::size_t k = 0; k < 9; ++k) o.covariance[17 * k] = 0.01;
    const HeapCallScope heap;
    if (published_++ % 10 == 0) output.publish_image(o);
    output.publish(o);
    heap_calls_.fetch_add(heap.calls());
  }

  std::atomic<std::uint64_t> heap_calls_{0};
  int published_ = 0;
  Again again_;
};

CanConfig config_of(bool fd, double rate_hz = 20) {
  CanConfig config;
  config.interface = kBus;
  config.base_id = kBase;
  config.fd = fd;
  config.rate_hz = rate_hz;
  return config;
}

/// Waits for a frame of that name.
std::optional<Seen> next_of(Peer& peer, const std::string& name, double seconds = 20) {
  std::optional<Seen> found;
  within(seconds, [&] {
    const auto seen = peer.hear(100);
    if (seen && is_ours(*seen) && dbc_file().at(static_cast<int>(seen->frame.can_id)).name == name) found = seen;
    return found.has_value();
  });
  return found;
}
/// A status with this state.
bool says(Peer& peer, const std::string& state, double seconds = 20) {
  return within(seconds, [&] {
    const auto status = next_of(peer, "EpilineStatus");
    return status && read(*status, "State").name == state;
  });
}
bool is_fresh(const Seen& odometry) {
  return static_cast<double>(odometry.at_ns / 1000) - read(odometry, "Time").value < 2e6;
}

TEST_F(CanBus, OdometryInFramesOfCanFd) {
  Peer peer;
  CanOutput output(config_of(true), Mat3::Identity());
  ASSERT_OPENS(output);
  std::uint64_t in_flight = 0;
  {
    Flight flight(output);
    std::int64_t time_before = 0;
    long long epoch_before = -1;
    for (int i = 0; i < 40; ++i) {
      const auto seen = next_of(peer, "EpilineOdometry");
      ASSERT_TRUE(seen);
      const auto time = static_cast<std::int64_t>(read(*seen, "Time").raw);
      EXPECT_GT(time, time_before) << "the same again";
      EXPECT_NEAR(read(*seen, "PositionX").value, position_at(time), 6e-5);
      EXPECT_NEAR(read(*seen, "PositionY").value, -position_at(time), 6e-5);
      EXPECT_NEAR(read(*seen, "VelocityX").value, velocity_at(time), 6e-5);
      EXPECT_EQ(read(*seen, "QuaternionW").value, 1);
      EXPECT_EQ(read(*seen, "State").name, "tracking");
      // by when it was sent, which is not later than when we saw it
      EXPECT_GE(read(*seen, "Age").value, 0);
      EXPECT_LE(read(*seen, "Age").value, 1e-9 * static_cast<double>(seen->at_ns - 1000 * time) + 1e-3);
      if (epoch_before >= 0) {
        EXPECT_EQ(read(*seen, "Epoch").raw, (epoch_before + 1) % 16);
      }
      epoch_before = read(*seen, "Epoch").raw;
      time_before = time;
    }
    EXPECT_TRUE(next_of(peer, "EpilineVelocitySd"));
    EXPECT_TRUE(says(peer, "tracking"));
    in_flight = flight.heap_calls();
  }
  output.close();
  EXPECT_GE(output.latency().count(), 20u) << "every image once: one in ten readings, two in five epochs";
  EXPECT_EQ(output.counts().disconnected, 0u);
  if (allocation_counting_available()) {
    EXPECT_EQ(in_flight, 0u);
    EXPECT_EQ(output.costs().heap_calls, 0u);
    EXPECT_EQ(output.costs().lock_calls, 0u);
  }
  const auto ms = [](std::int64_t ns) { return 1e-6 * static_cast<double>(ns); };
  std::printf("images' latency, emulated: p50 %.2f ms, most %.2f ms\n", ms(output.latency().quantile_ns(0.5)),
              ms(output.latency().most_ns()));
}

TEST_F(CanBus, AnInterfaceThatGoesDownComesBack) {
  CanOutput output(config_of(true), Mat3::Identity());
  ASSERT_OPENS(output);
  Flight flight(output);
  Peer peer;
  ASSERT_TRUE(next_of(peer, "EpilineOdometry"));
  for (int i = 1; i <= 2; ++i) {
    ASSERT_TRUE(set_bus("down"));
    ASSERT_TRUE(within(20, [&] { return output.bus() == BusState::kLost; }));
    EXPECT_TRUE(within(20, [&] { return output.counts().retries > 0; }));
    EXPECT_EQ(output.counts().last_error, ENETDOWN);
    peer.forget();
    ASSERT_TRUE(set_bus("up"));
    const std::int64_t up_ns = monotonic_ns();
    const auto seen = next_of(peer, "EpilineOdometry");
    ASSERT_TRUE(seen);
    EXPECT_TRUE(is_fresh(*seen));
    std::printf("odometry %.0f ms after the interface was up\n", 1e-6 * static_cast<double>(seen->at_ns - up_ns));
    EXPECT_EQ(output.counts().disconnected, static_cast<std::uint64_t>(i));
    EXPECT_TRUE(within(20, [&] { return output.bus() == BusState::kActive; }));
  }
}

TEST_F(CanBus, AnInterfaceThatIsRemovedComesBack) {
  CanOutput output(config_of(false), Mat3::Identity());
  ASSERT_OPENS(output);
  Flight flight(output);
  for (int i = 1; i <= 2; ++i) {
    ASSERT_TRUE(within(20, [&] { return output.bus() == BusState::kActive; }));
    remove_bus();
    ASSERT_TRUE(within(20, [&] { return output.bus() == BusState::kLost; }));
    ASSERT_TRUE(within(20, [&] { return output.counts().last_error == ENODEV; }));
    ASSERT_TRUE(make_bus());
    Peer peer;
    const auto seen = next_of(peer, "EpilineTime");
    ASSERT_TRUE(seen);
    EXPECT_TRUE(is_fresh(*seen));
  }
}

// A bus that takes 16 kbit/s: six classic frames, 20 times a second, are more.
TEST_F(CanBus, AFullQueueDropsWhatIsOld) {
  shell("/sbin/modprobe sch_tbf");
  Peer peer;
  CanOutput output(config_of(false), Mat3::Identity());
  ASSERT_OPENS(output);
  Flight flight(output);
  ASSERT_TRUE(next_of(peer, "EpilineTime"));
  if (!shell("tc qdisc add dev " + std::string(kBus) + " root tbf rate 8kbit burst 64 limit 256"))
    GTEST_SKIP() << "no tc, or no sch_tbf";
  EXPECT_TRUE(within(30, [&] { return output.counts().queue_full > 10 && output.counts().frames_dropped > 20; }))
      << output.counts().queue_full << " " << output.counts().frames_dropped;
  EXPECT_EQ(output.counts().disconnected, 0u);
  peer.forget();
  const auto slow = next_of(peer, "EpilineTime", 30);
  ASSERT_TRUE(slow) << "what the bus can take, it gets";
  EXPECT_TRUE(is_fresh(*slow));
  ASSERT_TRUE(shell("tc qdisc del dev " + std::string(kBus) + " root"));
  peer.forget();
  const std::uint64_t before = output.counts().epochs;
  EXPECT_TRUE(within(20, [&] { return output.counts().epochs > before + 20; }));
  const auto seen = next_of(peer, "EpilineTime");
  ASSERT_TRUE(seen);
  EXPECT_TRUE(is_fresh(*seen));
}

// vcan has no bus-off; its error frames are those a controller's driver would send.
TEST_F(CanBus, BusOffIsSilenceUntilTheRestart) {
  Peer peer;
  CanOutput output(config_of(true), Mat3::Identity());
  ASSERT_OPENS(output);
  Flight flight(output);
  ASSERT_TRUE(next_of(peer, "EpilineOdometry"));
  const auto error_frame = [&](std::uint32_t what) {
    return peer.say(CAN_ERR_FLAG | what, std::vector<std::uint8_t>(8));
  };
  ASSERT_TRUE(error_frame(CAN_ERR_BUSOFF));
  ASSERT_TRUE(within(20, [&] { return output.bus() == BusState::kOff; }));
  EXPECT_EQ(output.counts().bus_off, 1u);
  ASSERT_TRUE(error_frame(CAN_ERR_RESTARTED));
  ASSERT_TRUE(within(20, [&] { return output.bus() == BusState::kActive; }));
  EXPECT_EQ(output.counts().restarts, 1u);
  peer.forget();
  EXPECT_TRUE(next_of(peer, "EpilineOdometry"));
}

TEST_F(CanBus, OthersTrafficAtFullRateDoesNotDisturb) {
  CanOutput output(config_of(true), Mat3::Identity());
  ASSERT_OPENS(output);
  Flight flight(output);
  Flood flood;
  ASSERT_TRUE(within(60, [&] { return output.counts().epochs >= 60 && flood.frames() > 20'000; }))
      << output.counts().epochs << " epochs, " << flood.frames() << " frames";
  EXPECT_EQ(output.counts().error_frames, 0u);
  EXPECT_EQ(output.counts().disconnected, 0u);
}

TEST_F(CanBus, SaysWhatIsWrongWithTheInterface) {
  const auto error = [](const CanConfig& config) { return error_of_opening(CanOutput(config, Mat3::Identity())); };
  CanConfig config = config_of(true);
  const std::string bus = kBus;
  config.interface = "can99";
  EXPECT_EQ(error(config),
            "can99: No such device [SIOCGIFINDEX]; expected a network interface that `ip -br link` shows");
  config.interface = "lo";
  EXPECT_EQ(error(config), "lo: not a CAN interface; expected one that `ip -br link show type can` shows");
  config.interface = bus;
  ASSERT_TRUE(set_bus("down"));
  EXPECT_EQ(error(config), bus + ": Network is down [SIOCGIFFLAGS]; expected an interface that is up: ip link set " +
                               bus + " up type can bitrate BITRATE");
  ASSERT_TRUE(set_bus("mtu 16 up"));
  EXPECT_EQ(
      error(config),
      bus +
          ": the interface carries classic frames only; expected can.fd = false, or an interface that is set up with "
          "dbitrate BITRATE fd on");
  config.fd = false;
  EXPECT_EQ(error(config), "opened");
}

}  // namespace
}  // namespace epiline
