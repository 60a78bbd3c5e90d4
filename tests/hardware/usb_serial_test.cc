// A flight controller on USB: the kernel's own serial gadget at the other end of its own virtual bus, unplugged while
// the link is in use.
#include <gtest/gtest.h>

#include <cstdio>

#include "tests/drivers/links/mavlink/link_peer.h"
#include "tests/hardware/usb_serial_support.h"

namespace epiline::mavlink {
namespace {

constexpr std::int64_t kLong = 60'000;  // ms: an emulated computer

TEST(UsbSerial, LinkSurvivesUnplugging) {
  if (!SerialGadget::can_be_had()) GTEST_SKIP() << "no USB gadgets in this kernel";
  SerialGadget gadget;
  gadget.plug_in();
  MavlinkConfig config;
  config.serial = SerialGadget::kOurs;
  config.baud = 3'000'000;
  MavlinkLink link(config, Mat3::Identity());
  ASSERT_OPENS(link);
  Estimates estimates;
  Peer peer;
  for (int round = 1; round <= 3; ++round) {
    SCOPED_TRACE(round);
    peer.packets.clear();
    peer.take(SerialGadget::open_their_end());
    ASSERT_TRUE(fly(link, estimates, peer, kLong, [&] { return peer.all<Odometry>().size() >= 5; }));
    peer.heartbeat();
    ASSERT_TRUE(fly(link, estimates, peer, kLong, [&] { return link.state().peer.is_known; }));
    const auto messages = peer.all<Odometry>();
    for (std::size_t i = 1; i < messages.size(); ++i) ASSERT_GT(messages[i].time_usec, messages[i - 1].time_usec);
    gadget.unplug();
    peer.hang_up();
    ASSERT_TRUE(fly(link, estimates, peer, kLong, [&] { return !link.state().is_open; }));
    gadget.plug_in();  // under the same name, for the link has let go of it
    const std::int64_t back_ns = monotonic_ns();
    ASSERT_TRUE(fly(link, estimates, peer, kLong, [&] { return link.state().is_open; }));
    const auto took_ms = (monotonic_ns() - back_ns) / kMs;
    EXPECT_LE(took_ms, 2'000);
    std::printf("open again %d ms after the device was back\n", static_cast<int>(took_ms));
  }
  peer.take(SerialGadget::open_their_end());
  peer.packets.clear();
  ASSERT_TRUE(fly(link, estimates, peer, kLong, [&] { return peer.all<Odometry>().size() >= 5; }));
  link.close();
  const LinkState state = link.state();
  EXPECT_EQ(state.counts.disconnected, 3U);
  EXPECT_EQ(state.costs.heap_calls, 0U);
  EXPECT_EQ(state.costs.lock_calls, 0U);
}

}  // namespace
}  // namespace epiline::mavlink
