// Against a made-up bus, in its own time. tests/hardware/can_test.cc has the kernel's vcan, and the thread.
#include "drivers/links/can/can_output.h"

#include <gtest/gtest.h>

#include <functional>
#include <map>
#include <string>

#include "drivers/links/can/can_socket.h"
#include "drivers/links/can/dbc.h"
#include "platform/memory/allocation_count.h"
#include "tests/drivers/fake_can.h"
#include "tests/drivers/links/can/dbc_reader.h"

namespace epiline {
namespace {

std::string error_of(const CanConfig& config) {
  CanOutput output(config, Mat3::Identity());
  const Status status = output.open();
  return status ? "opened" : status.error().text();
}

TEST(CanOutput, SaysWhatIsWrongWithTheSettings) {
  EXPECT_EQ(error_of({}), "[can]: interface is not set; expected can.interface, as `ip -br link` shows it");
  EXPECT_EQ(error_of({.interface = "can0", .base_id = 0x7fe}), "[can]: base_id 2046; expected 1 to 2037");
}

// ---- on a bus ----

using test::FakeCanBus;
using test::FakeKernel;
using test::kMs;
using test::kSecond_ns;

constexpr int kBase = 0x300;

const std::map<int, dbc::MessageText>& dbc_file() {
  static const auto file = dbc::read(can::dbc_text(kBase));
  return file;
}
const dbc::MessageText& message_of(const FakeCanBus::Sent& sent) {
  return dbc_file().at(static_cast<int>(sent.frame.can_id));
}
dbc::Reading read(const FakeCanBus::Sent& sent, const std::string& signal) {
  const dbc::MessageText& message = message_of(sent);
  EXPECT_EQ(sent.fd, message.fd);
  EXPECT_EQ(sent.frame.len, message.size);
  return dbc::read(message.signals.at(signal), {sent.frame.data, sent.frame.len});
}

/// Odometry at 200 Hz into an output on a made-up bus.
struct Rig {
  explicit Rig(bool fd = true)
      : output({.interface = "can0", .fd = fd, .base_id = kBase, .rate_hz = 20}, Mat3::Identity(), kernel) {
    odometry.health = {HealthState::kTracking, 0, 90};
    for (std::size_t k = 0; k < 9; ++k) odometry.covariance[17 * k] = 0.01;
  }
  void begin() {
    const Status status = output.begin();
    ASSERT_TRUE(status) << status.error().text();
  }
  /// Frames that come meanwhile are in `bus.sent`, and no others. The heap of a turn is watched.
  void run(double seconds, bool publishes = true) {
    bus.sent.clear();
    const std::int64_t end_ns = kernel.clock_ns + static_cast<std::int64_t>(1e9 * seconds);
    while (kernel.clock_ns < end_ns) {
      const std::uint64_t kernels = kernel.heap_calls;
      const HeapCallScope heap;
      if (publishes) publish();
      kernel.horizon_ns = kernel.clock_ns + 5 * kMs;
      while (kernel.clock_ns < kernel.horizon_ns) output.turn();
      heap_calls += heap.calls() - (kernel.heap_calls - kernels);
    }
  }
  void publish() {
    odometry.stamp.ns = kernel.clock_ns / 1000 * 1000;
    if (++steps % 10 == 0) output.publish_image(odometry);
    output.publish(odometry);
  }
  std::vector<FakeCanBus::Sent> all(const std::string& name) const {
    std::vector<FakeCanBus::Sent> found;
    for (const FakeCanBus::Sent& sent : bus.sent)
      if (message_of(sent).name == name) found.push_back(sent);
    return found;
  }
  std::string last_state() const {
    const auto all_status = all("EpilineStatus");
    return all_status.empty() ? "" : read(all_status.back(), "State").name;
  }

  FakeKernel kernel;
  FakeCanBus bus{kernel, "can0"};
  CanOutput output;
  Odometry odometry;
  int steps = 0;
  std::uint64_t heap_calls = 0;
};

TEST(CanOutput, SaysWhatIsWrongWithTheInterface) {
  const auto error = [](bool fd, const std::function<void(FakeCanBus&)>& change) {
    Rig rig(fd);
    change(rig.bus);
    const Status status = rig.output.begin();
    EXPECT_EQ(rig.kernel.open_files(), status ? 2u : 0u);
    return status ? "opened" : status.error().text();
  };
  EXPECT_EQ(
      error(true, [](FakeCanBus& bus) { bus.speaks_can = false; }),
      "can0: the kernel has no CAN support: Address family not supported by protocol [socket]; expected the kernel "
      "module can-raw (modprobe can-raw)");
  EXPECT_EQ(error(true, [](FakeCanBus& bus) { bus.exists = false; }),
            "can0: No such device [SIOCGIFINDEX]; expected a network interface that `ip -br link` shows");
  EXPECT_EQ(error(true, [](FakeCanBus& bus) { bus.is_can = false; }),
            "can0: not a CAN interface; expected one that `ip -br link show type can` shows");
  EXPECT_EQ(
      error(true, [](FakeCanBus& bus) { bus.is_up = false; }),
      "can0: Network is down [SIOCGIFFLAGS]; expected an interface that is up: ip link set can0 up type can bitrate "
      "BITRATE");
  EXPECT_EQ(error(true, [](FakeCanBus& bus) { bus.has_fd = false; }),
            "can0: the interface carries classic frames only; expected can.fd = false, or an interface that is set up "
            "with dbitrate BITRATE fd on");
  EXPECT_EQ(error(false, [](FakeCanBus& bus) { bus.has_fd = false; }), "opened");
  EXPECT_EQ(error(true, [](FakeCanBus& bus) { bus.option_error = EPERM; }),
            "can0: cannot open a socket: Operation not permitted [setsockopt]; expected a CAN interface that this user "
            "may use");
}

// The other two kinds of socket: for the wheels' frames, and for `epiline check`, which listens to all.
TEST(CanSocket, WhatIsRefusedLeavesNoFileOpen) {
  FakeKernel kernel;
  FakeCanBus bus(kernel, "can0");
  can::CanSocket socket(kernel);
  const auto receive = [&] { return socket.open_to_receive("can0", 0x123, false); };
  const auto listen = [&] { return socket.open_to_listen("can0"); };
  EXPECT_FALSE(receive());
  EXPECT_FALSE(listen());
  EXPECT_EQ(kernel.open_files(), 1u) << "the one before is closed";
  bus.option_error = EINVAL;
  EXPECT_EQ(receive().error, EINVAL);
  EXPECT_EQ(kernel.open_files(), 0u);
  EXPECT_EQ(listen().error, EINVAL);
  EXPECT_EQ(kernel.open_files(), 0u);
  bus.option_error = 0;
  bus.is_up = false;
  EXPECT_EQ(receive().error, ENETDOWN);
  EXPECT_EQ(listen().error, ENETDOWN);
  EXPECT_EQ(kernel.open_files(), 0u);
}

TEST(CanOutput, SendsOdometryAtItsRateAndStatusFiveTimesASecond) {
  for (const bool fd : {true, false}) {
    Rig rig(fd);
    rig.begin();
    rig.run(10);
    const auto epochs = rig.all(fd ? "EpilineOdometry" : "EpilineTime");
    EXPECT_NEAR(static_cast<double>(epochs.size()), 200, 2);
    EXPECT_NEAR(static_cast<double>(rig.all("EpilineStatus").size()), 50, 2);
    EXPECT_NEAR(static_cast<double>(rig.all("EpilineVelocitySd").size()), 50, 2);
    for (std::size_t i = 1; i < epochs.size(); ++i) {
      ASSERT_GT(read(epochs[i], "Time").raw, read(epochs[i - 1], "Time").raw);
      ASSERT_EQ(read(epochs[i], "Epoch").raw, (read(epochs[i - 1], "Epoch").raw + 1) % 16);
      ASSERT_LE(epochs[i].at_ns - 1'000 * read(epochs[i], "Time").raw, 6 * kMs) << "an old one";
    }
    const CanOutputCounts counts = rig.output.counts();
    EXPECT_EQ(counts.epochs, epochs.size());
    EXPECT_EQ(counts.dropped + counts.queue_full + counts.frames_dropped + counts.disconnected, 0u);
    rig.output.close();
    // one image in ten readings, two in five epochs; the last may not have left
    EXPECT_NEAR(static_cast<double>(rig.output.latency().count()), 200, 2);
    if (allocation_counting_available()) {
      EXPECT_EQ(rig.heap_calls, 0u);
    }
  }
}

TEST(CanOutput, LostAndSilentAreToldAndOdometryStops) {
  Rig rig;
  rig.begin();
  rig.run(0.5, false);
  EXPECT_EQ(rig.last_state(), "initialising");
  rig.run(1);
  EXPECT_EQ(rig.last_state(), "tracking");
  rig.odometry.health.state = HealthState::kLost;
  rig.run(0.01);
  EXPECT_EQ(rig.last_state(), "lost") << "at once";
  rig.run(2);
  EXPECT_TRUE(rig.all("EpilineOdometry").empty());
  rig.odometry.health.state = HealthState::kDegraded;
  rig.run(1);
  EXPECT_FALSE(rig.all("EpilineOdometry").empty());
  rig.run(0.4, false);
  EXPECT_NE(rig.last_state(), "silent");
  rig.run(0.4, false);
  EXPECT_EQ(rig.last_state(), "silent");
  rig.run(2, false);
  EXPECT_TRUE(rig.all("EpilineOdometry").empty()) << "an old one again";
  EXPECT_NEAR(static_cast<double>(rig.all("EpilineStatus").size()), 10, 1);
  rig.run(0.1);
  EXPECT_FALSE(rig.all("EpilineOdometry").empty());
}

// The kernel tells a reader of the loss once; a frame may meet it earlier.
TEST(CanOutput, AnInterfaceThatIsLostIsTriedAtGrowingIntervals) {
  for (const auto& [is_removed, is_told] : {std::pair{false, true}, {true, true}, {false, false}, {true, false}}) {
    Rig rig;
    rig.begin();
    rig.run(1);
    const std::size_t files = rig.kernel.open_files();
    if (is_told) {
      is_removed ? rig.bus.remove() : rig.bus.set_up(false);
    } else {
      (is_removed ? rig.bus.exists : rig.bus.is_up) = false;
    }
    rig.run(0.1);
    EXPECT_EQ(rig.output.bus(), BusState::kLost);
    EXPECT_FALSE(rig.output.publish(rig.odometry));
    EXPECT_EQ(rig.kernel.open_files(), 1u) << "only what wakes the thread";
    rig.run(10.3);
    // after 50, 100, 200, 400, 800 ms, then each second
    EXPECT_EQ(rig.output.counts().retries, 13u);
    EXPECT_EQ(rig.output.counts().last_error, is_removed ? ENODEV : ENETDOWN) << "of the newest attempt to open it";
    EXPECT_TRUE(rig.bus.sent.empty());
    EXPECT_GT(rig.output.counts().dropped, 190u);
    EXPECT_EQ(rig.output.counts().queue_full, 0u);
    rig.bus.plug_in();
    rig.run(1.05);
    EXPECT_EQ(rig.output.bus(), BusState::kActive);
    EXPECT_EQ(rig.output.counts().disconnected, 1u);
    EXPECT_EQ(rig.kernel.open_files(), files);
    const auto odometry = rig.all("EpilineOdometry");
    ASSERT_FALSE(odometry.empty());
    EXPECT_LE(odometry[0].at_ns - 1'000 * read(odometry[0], "Time").raw, 6 * kMs);
    EXPECT_EQ(rig.heap_calls, 0u);
  }
}

// The queue takes some frames each 100 ms; six classic ones, 20 times a second, are more.
TEST(CanOutput, AFullQueueDropsWhatIsOld) {
  Rig rig(false);
  rig.begin();
  rig.run(1);
  rig.bus.room = 0;
  rig.run(0.2);
  EXPECT_TRUE(rig.bus.sent.empty());
  EXPECT_NEAR(static_cast<double>(rig.output.counts().queue_full), 200, 40) << "each millisecond";
  for (int i = 0; i < 50; ++i) {
    rig.bus.room = 4;
    rig.run(0.1);
    for (const FakeCanBus::Sent& sent : rig.all("EpilineTime"))
      EXPECT_LE(sent.at_ns - 1'000 * read(sent, "Time").raw, 100 * kMs);
  }
  const CanOutputCounts counts = rig.output.counts();
  EXPECT_GT(counts.frames_dropped, 20u);
  EXPECT_EQ(counts.disconnected, 0u);
  rig.bus.room = 2;
  rig.run(0.1);
  rig.run(0.2, false);
  rig.bus.room = 100'000;
  rig.run(0.1, false);
  for (const FakeCanBus::Sent& sent : rig.bus.sent)
    EXPECT_EQ(message_of(sent).name, "EpilineStatus") << "the rest of an epoch, after 0.2 s";
  rig.run(1);
  EXPECT_NEAR(static_cast<double>(rig.all("EpilineTime").size()), 20, 1);
}

TEST(CanOutput, BusOffIsSilenceUntilTheRestart) {
  Rig rig;
  rig.begin();
  rig.run(1);
  rig.bus.tell(CAN_ERR_BUSOFF);
  rig.run(0.3);
  EXPECT_EQ(rig.output.bus(), BusState::kOff);
  EXPECT_EQ(rig.output.counts().bus_off, 1u);
  rig.run(0.3);
  EXPECT_TRUE(rig.bus.sent.empty());
  rig.bus.tell(CAN_ERR_RESTARTED);
  rig.run(0.3);
  EXPECT_EQ(rig.output.bus(), BusState::kActive);
  EXPECT_EQ(rig.output.counts().restarts, 1u);
  EXPECT_FALSE(rig.all("EpilineOdometry").empty());
  EXPECT_FALSE(rig.all("EpilineStatus").empty());
}

TEST(CanOutput, ABusThatNobodyRestartsIsTriedAfterASecond) {
  Rig rig;
  rig.begin();
  rig.run(1);
  rig.bus.tell(CAN_ERR_BUSOFF);
  rig.run(0.95);
  EXPECT_EQ(rig.output.bus(), BusState::kOff);
  rig.run(0.4);
  EXPECT_EQ(rig.output.bus(), BusState::kActive);
  EXPECT_FALSE(rig.all("EpilineOdometry").empty());
  EXPECT_EQ(rig.output.counts().disconnected, 0u);
}

TEST(CanOutput, ErrorFramesAreCountedAndAPassiveBusIsToldAsLongAsItIs) {
  Rig rig;
  rig.begin();
  rig.run(1);
  for (int i = 0; i < 3; ++i) rig.bus.tell(CAN_ERR_ACK);
  rig.run(0.3);
  EXPECT_EQ(rig.output.counts().error_frames, 3u);
  EXPECT_EQ(rig.output.bus(), BusState::kActive);
  rig.bus.tell(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE);
  rig.run(0.3);
  EXPECT_EQ(rig.output.bus(), BusState::kPassive);
  EXPECT_FALSE(rig.all("EpilineOdometry").empty()) << "it still sends";
  rig.bus.tell(CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE);
  rig.run(0.3);
  EXPECT_EQ(rig.output.bus(), BusState::kActive);
  rig.bus.tell(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_PASSIVE);
  rig.run(0.3);
  EXPECT_EQ(rig.output.bus(), BusState::kPassive);
  rig.bus.tell(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_WARNING);
  rig.run(0.3);
  EXPECT_EQ(rig.output.bus(), BusState::kActive) << "its errors are fewer again";
}

}  // namespace
}  // namespace epiline
