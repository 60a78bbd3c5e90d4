// A flight controller on USB: the kernel's own serial gadget at the other end of its own virtual bus, unplugged while
// the link is in use.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <termios.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "platform/concurrency/lock_count.h"
#include "platform/memory/allocation_count.h"
#include "tests/drivers/output/mavlink/link_peer.h"

namespace epiline::mavlink {
namespace {

constexpr std::int64_t kLong = 60'000;  // ms: an emulated computer
constexpr const char* kOurs = "/dev/ttyACM0";
constexpr const char* kTheirs = "/dev/ttyGS0";

void write_line(const std::string& path, const std::string& text) {
  std::ofstream file(path);
  file << text << '\n' << std::flush;
  ASSERT_TRUE(file) << path;
}

bool wait_until(const std::function<bool()>& done) {
  const std::int64_t until_ns = monotonic_ns() + kLong * kMs;
  while (!done() && monotonic_ns() < until_ns) ::usleep(1000);
  return done();
}

/// A USB device with one serial function; its cable is a line in a file.
class SerialGadget {
 public:
  SerialGadget() {
    namespace fs = std::filesystem;
    fs::create_directories(kFolder + "/functions/acm.0");
    fs::create_directories(kFolder + "/configs/c.1");
    write_line(kFolder + "/idVendor", "0x1209");
    write_line(kFolder + "/idProduct", "1");
    fs::create_directory_symlink(kFolder + "/functions/acm.0", kFolder + "/configs/c.1/acm.0");
  }
  ~SerialGadget() {
    namespace fs = std::filesystem;
    unplug();
    fs::remove(kFolder + "/configs/c.1/acm.0");
    fs::remove(kFolder + "/configs/c.1");
    fs::remove(kFolder + "/functions/acm.0");
    fs::remove(kFolder);
  }
  void plug_in() {
    write_line(kFolder + "/UDC", "dummy_udc.0");
    ASSERT_TRUE(wait_until([] { return std::filesystem::exists(kOurs); })) << "no " << kOurs;
  }
  void unplug() const {
    std::ofstream(kFolder + "/UDC") << '\n' << std::flush;
    wait_until([] { return !std::filesystem::exists(kOurs); });
  }

 private:
  const std::string kFolder = "/sys/kernel/config/usb_gadget/epiline";
};

void open_their_end(Peer& peer) {
  const int fd = ::open(kTheirs, O_RDWR | O_NOCTTY | O_NONBLOCK);
  ASSERT_GE(fd, 0);
  termios raw{};
  ::tcgetattr(fd, &raw);
  ::cfmakeraw(&raw);
  ::tcsetattr(fd, TCSANOW, &raw);
  peer.take(fd);
}

TEST(UsbSerial, LinkSurvivesUnplugging) {
  if (!std::filesystem::exists("/sys/kernel/config/usb_gadget")) GTEST_SKIP() << "no USB gadgets in this kernel";
  SerialGadget gadget;
  gadget.plug_in();
  MavlinkConfig config;
  config.serial = kOurs;
  config.baud = 3'000'000;
  MavlinkLink link(config, Mat3::Identity());
  const Status status = link.open();
  ASSERT_TRUE(status) << status.error().text();
  Estimates estimates;
  Peer peer;
  for (int round = 1; round <= 3; ++round) {
    SCOPED_TRACE(round);
    peer.packets.clear();
    open_their_end(peer);
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
  open_their_end(peer);
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
