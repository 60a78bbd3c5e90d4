// The controller on a real line: bytes through the kernel, both ways.
#include "drivers/program/hil/controller_thread.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <filesystem>
#include <functional>
#include <string>

#include "platform/time/monotonic.h"

namespace epiline::hil {
namespace {

/// Says hello on a file, answers the time, until the controller's questions have come; true: they have.
bool converse(int fd) {
  mavlink::Parser parser;
  std::uint8_t sequence = 0;
  const auto send = [&](const auto& message) {
    const auto frame = mavlink::frame_of(mavlink::pack(message, {}, sequence++));
    EXPECT_EQ(::write(fd, frame.data.data(), frame.size), static_cast<ssize_t>(frame.size));
  };
  send(mavlink::Heartbeat{});
  bool heard_heartbeat = false;
  const std::int64_t until_ns = monotonic_ns() + 20'000'000'000;
  for (int answers = 0; monotonic_ns() < until_ns;) {
    pollfd ready{fd, POLLIN, 0};
    ::poll(&ready, 1, 100);
    std::array<std::uint8_t, 512> bytes{};
    const ssize_t got = ::read(fd, bytes.data(), bytes.size());
    if (got <= 0) continue;
    std::span<const std::uint8_t> left{bytes.data(), static_cast<std::size_t>(got)};
    while (const mavlink::Packet* packet = parser.next(left)) {
      mavlink::Heartbeat heartbeat;
      if (mavlink::unpack(*packet, heartbeat)) heard_heartbeat = heartbeat.autopilot == 12;
      mavlink::Timesync question;
      if (!mavlink::unpack(*packet, question) || question.tc1 != 0) continue;
      question.tc1 = monotonic_ns();
      send(question);
      ++answers;
    }
    if (answers >= 3 && heard_heartbeat) return true;
  }
  return false;
}

/// The controller on a line, a companion at its other end.
void expect_conversation(ControllerLine& line, const std::function<int()>& connect) {
  ControllerModel model({});
  ControllerThread thread(model, line);
  ASSERT_TRUE(thread.start());
  const int fd = connect();
  ASSERT_GE(fd, 0);
  EXPECT_TRUE(converse(fd));
  ::close(fd);
  thread.stop();
  const Verdict verdict = model.finish(HostStamp{monotonic_ns()});
  EXPECT_GT(verdict.of(Rule::kTimesyncAnswers).checked, 0u);
  EXPECT_EQ(verdict.of(Rule::kSequence).broken, 0u);
  EXPECT_EQ(verdict.of(Rule::kFusion).broken, 1u) << "it sent no odometry";
}

TEST(ControllerThread, TalksThroughAPty) {
  auto line = open_pty_line();
  ASSERT_TRUE(line) << line.error().text();
  expect_conversation(**line, [&] { return ::open((*line)->companion_end().c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK); });
}

TEST(ControllerThread, APtyHasTheNameItIsGiven) {
  const std::filesystem::path folder =
      std::filesystem::path(testing::TempDir()) / ("epiline_pty_" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder);
  const std::filesystem::path name = folder / "controller";
  std::filesystem::create_symlink("/dev/pts/4711", name);  // left behind by somebody who was killed
  {
    auto line = open_pty_line(name);
    ASSERT_TRUE(line) << line.error().text();
    EXPECT_EQ((*line)->companion_end(), name.string());
    expect_conversation(**line, [&] { return ::open(name.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK); });
  }
  EXPECT_FALSE(std::filesystem::is_symlink(name)) << "gone with the line";
  // What is somebody else's stays.
  std::filesystem::create_symlink("/dev/ttyACM0", name);
  const auto refused = open_pty_line(name);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().kind, ErrorKind::kUsage);
  EXPECT_EQ(std::filesystem::read_symlink(name), "/dev/ttyACM0");
  EXPECT_FALSE(open_pty_line(folder / "no_folder" / "controller"));
  std::filesystem::remove_all(folder);
}

TEST(ControllerThread, TalksThroughUdp) {
  auto line = open_udp_line();
  ASSERT_TRUE(line) << line.error().text();
  const std::string& to = (*line)->companion_end();
  expect_conversation(**line, [&] {
    const int fd = ::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(std::stoi(to.substr(to.find(':') + 1))));
    ::inet_pton(AF_INET, to.substr(0, to.find(':')).c_str(), &address.sin_addr);
    EXPECT_EQ(::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    return fd;
  });
}

TEST(ControllerLine, ASerialPortHasAWordForItsFaults) {
  EXPECT_EQ(open_serial_line("/dev/null", 921'600).error().text(),
            "/dev/null: Inappropriate ioctl for device [TCGETS2]; expected a serial device that is wired to "
            "the configured one, or pty, udp or a CAN interface");
  EXPECT_FALSE(open_serial_line("/dev/there_is_none", 921'600));
}

/// As live runs do: also those without a constant in the C library.
TEST(ControllerLine, ASerialPortTakesAnySpeed) {
  const auto line = open_pty_line();
  ASSERT_TRUE(line) << line.error().text();
  for (const int baud : {57'600, 123'456, 250'000, 12'000'000}) {
    const auto wire = open_serial_line((*line)->companion_end(), baud);
    EXPECT_TRUE(wire) << wire.error().text();
  }
}

}  // namespace
}  // namespace epiline::hil
