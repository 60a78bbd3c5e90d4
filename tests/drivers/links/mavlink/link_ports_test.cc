// The link's settings, and the link over pseudo terminals and sockets of this computer.
#include <gtest/gtest.h>

#include "drivers/links/mavlink/link.h"
#include "drivers/links/mavlink/udp_port.h"
#include "platform/concurrency/lock_count.h"
#include "platform/memory/allocation_count.h"
#include "tests/drivers/links/mavlink/fake_line.h"

namespace epiline::mavlink {
namespace {

const Mat3 kStraight = Mat3::Identity();
constexpr std::int64_t kPatience = 20'000;  // ms: a busy computer

void open(MavlinkLink& link) {
  const Status status = link.open();
  ASSERT_TRUE(status) << status.error().text();
}

std::string error_of(const MavlinkConfig& config) {
  MavlinkLink link(config, kStraight);
  const Status status = link.open();
  return status ? "" : status.error().text();
}

TEST(MavlinkLink, SaysWhatIsWrongWithTheSettings) {
  MavlinkConfig config;
  EXPECT_EQ(error_of(config), "[mavlink]: neither serial nor udp is set; expected one of them");
  config.serial = "/dev/nothing_of_the_kind";
  EXPECT_EQ(
      error_of(config),
      "/dev/nothing_of_the_kind: No such file or directory [open]; expected a connected serial device (epiline devices "
      "lists them)");
  config.baud = 57'600;
  EXPECT_EQ(error_of(config),
            "mavlink.baud: 57600 for 40 odometry messages per second; expected at least 113000, or a lower "
            "mavlink.rate_hz");
  config.udp = "127.0.0.1:14550";
  EXPECT_EQ(error_of(config), "[mavlink]: both serial and udp are set; expected one of them");
  config.serial.clear();
  for (const char* wrong : {"localhost:14550", "127.0.0.1", "127.0.0.1:", "127.0.0.1:0", "127.0.0.1:70000", ":14550",
                            "127.0.0.1:14550x", "127.0.0.1:-1"}) {
    config.udp = wrong;
    EXPECT_EQ(error_of(config),
              std::string("mavlink.udp: '") + wrong + "'; expected ADDRESS:PORT in numbers, e.g. 192.168.1.10:14580");
  }
  config.udp = "127.0.0.1:14550";
  config.udp_listen = "14540";
  EXPECT_EQ(error_of(config), "mavlink.udp_listen: '14540'; expected ADDRESS:PORT in numbers, e.g. 192.168.1.10:14580");
  ImuDeviceConfig imu;
  MavlinkLink turned(config, Mat3(Eigen::AngleAxisd(0.1, Vec3::UnitZ())), imu);
  EXPECT_EQ(turned.open().error().text(),
            "[body]: angles with imu.driver = \"mavlink\"; expected angles of 0: a flight controller sends its samples "
            "in the vehicle's axes");
  config = serial_config("/dev/null");
  EXPECT_EQ(error_of(config), "/dev/null: Inappropriate ioctl for device [TCGETS2]; expected a serial device");
  config.frame = 1;
  EXPECT_NE(error_of(config).find("mavlink.frame: local-ned without mavlink.heading_deg"), std::string::npos);
}

TEST(MavlinkLink, HasTheLineAlone) {
  PseudoTerminal line;
  MavlinkLink link(serial_config(line.path()), kStraight);
  open(link);
  const std::string error = error_of(serial_config(line.path()));
  EXPECT_NE(error.find("expected a port that no other program has open"), std::string::npos) << error;
  link.close();
  EXPECT_EQ(error_of(serial_config(line.path())), "");
}

// ---- sockets ----

/// A socket on a port of the loopback, and the text of its address.
int bound_socket(std::string& address) {
  const int fd = ::socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in own{};
  own.sin_family = AF_INET;
  own.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t length = sizeof own;
  EXPECT_EQ(::bind(fd, reinterpret_cast<sockaddr*>(&own), length), 0);
  ::getsockname(fd, reinterpret_cast<sockaddr*>(&own), &length);
  address = "127.0.0.1:" + std::to_string(ntohs(own.sin_port));
  return fd;
}
/// Answers go to the address that spoke last, and that must be the link.
sockaddr_in address_of_sender(int fd) {
  sockaddr_in from{};
  socklen_t length = sizeof from;
  std::uint8_t byte = 0;
  pollfd wait{fd, POLLIN, 0};
  EXPECT_EQ(::poll(&wait, 1, static_cast<int>(kPatience)), 1);
  ::recvfrom(fd, &byte, 1, 0, reinterpret_cast<sockaddr*>(&from), &length);
  return from;
}

TEST(MavlinkLink, SpeaksByDatagramsWithItsPeerAlone) {
  std::string address;
  Peer peer(bound_socket(address));
  MavlinkLink link(config_with(&MavlinkConfig::udp, address), kStraight);
  open(link);
  const sockaddr_in own = address_of_sender(peer.fd());
  EXPECT_EQ(ntohl(own.sin_addr.s_addr), INADDR_LOOPBACK);
  ASSERT_EQ(::connect(peer.fd(), reinterpret_cast<const sockaddr*>(&own), sizeof own), 0);
  std::string stranger_address;
  Peer stranger(bound_socket(stranger_address));
  ASSERT_EQ(::connect(stranger.fd(), reinterpret_cast<const sockaddr*>(&own), sizeof own), 0);
  stranger.heartbeat({1, 99});
  stranger.send(Timesync{.ts1 = 5});
  peer.heartbeat();
  Estimates estimates;
  ASSERT_TRUE(fly(link, estimates, peer, kPatience,
                  [&] { return peer.all<Odometry>().size() >= 10 && link.state().peer.is_known; }));
  EXPECT_EQ(link.state().peer.address.component, 1);
  EXPECT_EQ(link.counts().packets, 1U);
  stranger.read();
  EXPECT_TRUE(stranger.packets.empty());
}

TEST(MavlinkLink, WaitsForAPeerThatIsNotThere) {
  std::string address;
  Peer peer(bound_socket(address));
  peer.hang_up();
  MavlinkLink link(config_with(&MavlinkConfig::udp, address), kStraight);
  open(link);
  Estimates estimates;
  ASSERT_TRUE(fly(link, estimates, peer, kPatience, [&] { return link.counts().write_errors > 0; }));
  EXPECT_TRUE(link.state().is_open);
}

/// Refuses one of the two steps.
class RefusedSocket final : public test::FakeFile {
 public:
  explicit RefusedSocket(int bind_error, int connect_error) : bind_error_(bind_error), connect_error_(connect_error) {}
  int bind(const sockaddr* /*address*/, socklen_t /*length*/) override {
    return bind_error_ != 0 ? test::refuse(bind_error_) : 0;
  }
  int connect(const sockaddr* /*address*/, socklen_t /*length*/) override {
    return connect_error_ != 0 ? test::refuse(connect_error_) : 0;
  }

 private:
  int bind_error_, connect_error_;
};

TEST(MavlinkLink, ASocketThatIsRefusedIsClosed) {
  test::FakeKernel kernel;
  std::shared_ptr<RefusedSocket> socket;
  kernel.make_socket = [&](int, int, int) { return socket; };
  UdpPort port("port", *udp_address("192.168.1.10:14580", "mavlink.udp"), *udp_address("0.0.0.0:14540", "udp_listen"),
               kernel);
  for (const auto& [in_use, unreachable] : {std::pair{EADDRINUSE, 0}, std::pair{0, ENETUNREACH}}) {
    socket = std::make_shared<RefusedSocket>(in_use, unreachable);
    const DeviceTrouble trouble = port.open();
    EXPECT_EQ(trouble.error, in_use + unreachable);
    EXPECT_LT(port.fd(), 0);
    EXPECT_EQ(kernel.open_files(), 0U);
  }
  socket = std::make_shared<RefusedSocket>(0, 0);
  EXPECT_FALSE(port.open());
  EXPECT_EQ(kernel.open_files(), 1U);
}

// ---- costs ----

TEST(MavlinkLink, TakesNoHeapAndNoLock) {
  PseudoTerminal line;
  MavlinkLink link(serial_config(line.path()), kStraight);
  open(link);
  Estimates estimates;
  const std::uint64_t locks = lock_calls_of_this_thread();
  const HeapCallScope heap;
  for (int i = 0; i < 400; ++i) {
    estimates.step(link);
    ::usleep(2000);
    if (i == 200) line.peer.hang_up();  // and when it is lost
  }
  EXPECT_EQ(heap.calls(), 0U);
  EXPECT_EQ(lock_calls_of_this_thread(), locks);
  link.close();
  EXPECT_GT(link.counts().retries, 0U);
  EXPECT_EQ(link.state().costs.heap_calls, 0U);
  EXPECT_EQ(link.state().costs.lock_calls, 0U);
}

}  // namespace
}  // namespace epiline::mavlink
