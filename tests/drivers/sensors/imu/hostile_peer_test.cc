// A peer that means harm, at the full rate of the line: our odometry goes on, the clock's model and the IMU's readings
// stay what they are, nothing is allocated.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <random>
#include <thread>

#include "drivers/sensors/imu/mavlink_imu.h"
#include "tests/drivers/links/mavlink/link_peer.h"

namespace epiline::mavlink {
namespace {

constexpr std::int64_t kLong = 30'000;             // ms
constexpr std::int64_t kAhead_ns = 777'000 * kMs;  ///< the honest flight controller's clock

using Random = std::mt19937;

std::int64_t any_time(Random& random) {
  const std::array<std::int64_t, 6> special = {0, -1, 1, INT64_MAX, INT64_MIN, monotonic_ns()};
  if (random() % 2 == 0) return special[random() % special.size()];
  return static_cast<std::int64_t>((std::uint64_t{random()} << 32U) | random());
}
/// Of a time that may be, or of none; a value no sensor gives.
HighresImu absurd_reading(Random& random) {
  const std::array<float, 5> absurd = {INFINITY, -INFINITY, NAN, 1e38F, -500.0F};
  const bool is_now = random() % 2 == 0;
  HighresImu m{.zacc = -5, .fields_updated = 0x3f};
  m.time_usec = static_cast<std::uint64_t>(is_now ? (monotonic_ns() + kAhead_ns) / 1000 : any_time(random));
  const std::array fields = {&HighresImu::xacc, &HighresImu::zacc, &HighresImu::ygyro, &HighresImu::zgyro};
  m.*fields[random() % fields.size()] = absurd[random() % absurd.size()];
  return m;
}
/// That might be the flight controller's, were it not for the time or the sender.
HighresImu false_reading(std::int64_t time_ns) {
  return {.time_usec = static_cast<std::uint64_t>(time_ns / 1000), .zacc = -5, .fields_updated = 0x3f};
}

/// Some bytes of an attack; a frame or noise.
void append_attack(std::vector<std::uint8_t>& bytes, Random& random) {
  const auto add = [&](const auto& message, Address from) {
    const FrameBytes frame = frame_of(pack(message, from, static_cast<std::uint8_t>(random())));
    bytes.insert(bytes.end(), frame.bytes().begin(), frame.bytes().end());
  };
  const Address stranger{static_cast<std::uint8_t>(2 + random() % 250), 1};
  const Address from = random() % 2 == 0 ? kController : stranger;
  switch (random() % 10) {
    case 0:
      for (int i = 0; i < 300; ++i) bytes.push_back(static_cast<std::uint8_t>(random()));
      break;
    case 1:  // what looks like the beginning of the longest frame, again and again
      for (int i = 0; i < 60; ++i) bytes.insert(bytes.end(), {0xfd, 0xff, 0, 0, 0});
      break;
    case 2:
      add(Timesync{.tc1 = 0, .ts1 = any_time(random)}, from);
      break;
    case 3:
      add(Timesync{.tc1 = any_time(random), .ts1 = any_time(random)}, from);
      break;
    case 4:
      add(absurd_reading(random), from);
      break;
    case 5:
      add(CommandAck{.command = 511, .result = static_cast<std::uint8_t>(random())}, from);
      break;
    case 6:
      add(Heartbeat{.type = static_cast<std::uint8_t>(random()), .autopilot = static_cast<std::uint8_t>(random())},
          Address{1, static_cast<std::uint8_t>(random())});
      break;
    case 7:
      add(false_reading(monotonic_ns() + kAhead_ns), stranger);
      break;
    case 8:
      add(false_reading(any_time(random)), kController);
      break;
    default:
      add(Odometry{.time_usec = 5}, Address{});
      break;  // as if from ourselves
  }
}

/// An honest flight controller on a line on which somebody else talks as well, as much as the line takes.
class AttackedController {
 public:
  explicit AttackedController(Peer& peer) : peer_(peer) {
    peer_.on_packet = [this](const Packet& packet) {
      Timesync question;
      if (unpack(packet, question) && question.tc1 == 0)
        speak(Timesync{.tc1 = monotonic_ns() + kAhead_ns, .ts1 = question.ts1});
    };
    thread_ = std::thread([this] { run(); });
  }
  ~AttackedController() {
    stop_ = true;
    thread_.join();
  }
  std::atomic<bool> attacks{false};
  std::atomic<std::uint64_t> attack_bytes{0}, odometry{0}, answers{0};

 private:
  template <class Message>
  void speak(const Message& message) {
    const FrameBytes frame = frame_of(pack(message, kController, sequence_++));
    out_.insert(out_.end(), frame.bytes().begin(), frame.bytes().end());
  }
  /// As much as goes; the rest stays for the next time, for a frame cut short is no honest one.
  void flush() {
    const ssize_t n = ::write(peer_.fd(), out_.data(), out_.size());
    if (n > 0) out_.erase(out_.begin(), out_.begin() + n);
  }
  void run() {
    Random random(1);
    std::int64_t next_heartbeat_ns = 0, next_reading_ns = 0;
    while (!stop_) {
      const std::int64_t now_ns = monotonic_ns();
      peer_.read();
      for (const Packet& packet : peer_.packets) {
        odometry += packet.id == Odometry::kId ? 1U : 0U;
        answers += packet.id == Timesync::kId ? 1U : 0U;
      }
      peer_.packets.clear();
      if (now_ns > next_heartbeat_ns) {
        speak(Heartbeat{.type = 2, .autopilot = 12});
        next_heartbeat_ns = now_ns + 500 * kMs;
      }
      if (now_ns > next_reading_ns) {
        speak(HighresImu{.time_usec = static_cast<std::uint64_t>((now_ns + kAhead_ns) / 1000),
                         .zacc = -9.8F,
                         .fields_updated = 0x3f});
        next_reading_ns = now_ns + 5 * kMs;
      }
      flush();
      while (attacks && out_.size() < 2000) {
        const std::size_t before = out_.size();
        append_attack(out_, random);
        attack_bytes += out_.size() - before;
      }
      flush();
      if (!attacks) ::usleep(500);
    }
  }

  Peer& peer_;
  std::vector<std::uint8_t> out_;
  std::uint8_t sequence_ = 0;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

TEST(MavlinkHostilePeer, MovesNothingAndStopsNothing) {
  PseudoTerminal line;
  ImuDeviceConfig config;
  config.driver = static_cast<int>(ImuDriver::kMavlink);
  MavlinkLink link(serial_config(line.path()), Mat3::Identity(), config);
  ASSERT_TRUE(link.open());
  AttackedController controller(line.peer);
  MavlinkImu imu(link);
  const Status status = imu.open();
  ASSERT_TRUE(status) << status.error().text();
  controller.attacks = true;
  Estimates estimates;
  const LinkState before = link.state();
  const std::int64_t begin_ns = monotonic_ns();
  std::array<ImuSample, 64> samples;
  std::uint64_t wrong_readings = 0, readings = 0;
  // until there was enough of everything
  while (monotonic_ns() - begin_ns < kLong * kMs &&
         (controller.odometry < 100 || controller.attack_bytes < 1'000'000 || readings < 100)) {
    estimates.step(link);
    std::size_t count = 0;
    imu.read(samples, count, Span::from_milliseconds(5));
    for (std::size_t i = 0; i < count; ++i, ++readings) {
      const double norm = std::hypot(samples[i].specific_force_m_s2[0], samples[i].specific_force_m_s2[1],
                                     samples[i].specific_force_m_s2[2]);
      wrong_readings += std::abs(norm - 9.8) > 0.01 ? 1U : 0U;
    }
  }
  const double seconds = 1e-9 * static_cast<double>(monotonic_ns() - begin_ns);
  link.close();
  const LinkState state = link.state();
  EXPECT_GE(controller.odometry, 100U);
  EXPECT_GE(readings, 100U);
  EXPECT_GE(controller.attack_bytes, 1'000'000U);
  EXPECT_EQ(wrong_readings, 0U);
  // answers: to a hundred questions a second and a burst; among them our own questions to the flight controller
  EXPECT_LE(static_cast<double>(controller.answers), (100 + 10 + 20) * seconds + 40);
  EXPECT_EQ(state.peer.address.component, 1);
  EXPECT_EQ(state.clock.jumps, before.clock.jumps);
  EXPECT_LE(std::abs(state.clock.offset.ns + kAhead_ns), 5 * kMs);
  EXPECT_EQ(state.counts.disconnected, 0U);
  EXPECT_EQ(state.costs.heap_calls, 0U);
  EXPECT_EQ(state.costs.lock_calls, 0U);
  EXPECT_GT(state.counts.refused_questions + state.counts.refused_answers + state.counts.strangers, 0U);
  std::printf("%.1f s, %.0f kB/s of attack, %.1f odometry/s, %.1f %% of a processor\n", seconds,
              1e-3 * static_cast<double>(controller.attack_bytes) / seconds,
              static_cast<double>(controller.odometry) / seconds,
              1e-7 * static_cast<double>(state.costs.cpu_ns) / seconds);
}

// As many datagrams as a processor can send, empty ones and single bytes: the byte counts nothing, the reading does.
TEST(MavlinkHostilePeer, TinyDatagramsTakeNoProcessor) {
  const int fd = ::socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t length = sizeof address;
  ASSERT_EQ(::bind(fd, reinterpret_cast<sockaddr*>(&address), length), 0);
  ::getsockname(fd, reinterpret_cast<sockaddr*>(&address), &length);
  Peer peer(fd);
  MavlinkConfig config;
  config.udp = "127.0.0.1:" + std::to_string(ntohs(address.sin_port));
  MavlinkLink link(config, Mat3::Identity());
  ASSERT_TRUE(link.open());
  pollfd wait{fd, POLLIN, 0};
  ASSERT_EQ(::poll(&wait, 1, static_cast<int>(kLong)), 1);
  sockaddr_in own{};
  std::uint8_t byte = 0;
  ::recvfrom(fd, &byte, 1, 0, reinterpret_cast<sockaddr*>(&own), &length);
  ASSERT_EQ(::connect(fd, reinterpret_cast<sockaddr*>(&own), sizeof own), 0);
  std::atomic<bool> stop{false};
  std::atomic<std::uint64_t> sent{0};
  std::thread flood([&] {
    while (!stop) sent += ::send(fd, &byte, sent % 2, 0) >= 0 ? 1U : 0U;
  });
  Estimates estimates;
  const std::int64_t begin_ns = monotonic_ns();
  const bool went_on =
      fly(link, estimates, peer, kLong, [&] { return peer.all<Odometry>().size() >= 60 && sent >= 100'000; });
  const double seconds = 1e-9 * static_cast<double>(monotonic_ns() - begin_ns);
  stop = true;
  flood.join();
  link.close();
  EXPECT_TRUE(went_on);
  const LinkState state = link.state();
  std::printf("%.0f thousand datagrams a second, %.1f %% of a processor\n", 1e-3 * static_cast<double>(sent) / seconds,
              1e-7 * static_cast<double>(state.costs.cpu_ns) / seconds);
  // 500 kB/s, each counted as 32 bytes at least
  EXPECT_LE(static_cast<double>(state.counts.pieces), 15'625 * (seconds + 1) + 1024);
}

}  // namespace
}  // namespace epiline::mavlink
