// A peer that means harm, at the full rate of the line: our odometry goes on, the clock's model and the IMU's readings
// stay what they are, nothing is allocated.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "platform/concurrency/lock_count.h"
#include "platform/memory/allocation_count.h"
#include "tests/drivers/links/mavlink/fake_line.h"

namespace epiline::mavlink {
namespace {

constexpr std::int64_t kAhead_ns = 777'000 * kMs;  ///< the honest flight controller's clock

using Random = std::mt19937;

std::int64_t any_time(Random& random, std::int64_t now_ns) {
  const std::array<std::int64_t, 6> special = {0, -1, 1, INT64_MAX, INT64_MIN, now_ns};
  if (random() % 2 == 0) return special[random() % special.size()];
  return static_cast<std::int64_t>((std::uint64_t{random()} << 32U) | random());
}
/// Of a time that may be, or of none; a value no sensor gives.
HighresImu absurd_reading(Random& random, std::int64_t now_ns) {
  const std::array<float, 5> absurd = {INFINITY, -INFINITY, NAN, 1e38F, -500.0F};
  const bool is_now = random() % 2 == 0;
  HighresImu m{.zacc = -5, .fields_updated = 0x3f};
  m.time_usec = static_cast<std::uint64_t>(is_now ? (now_ns + kAhead_ns) / 1000 : any_time(random, now_ns));
  const std::array fields = {&HighresImu::xacc, &HighresImu::zacc, &HighresImu::ygyro, &HighresImu::zgyro};
  m.*fields[random() % fields.size()] = absurd[random() % absurd.size()];
  return m;
}
/// That might be the flight controller's, were it not for the time or the sender.
HighresImu false_reading(std::int64_t time_ns) {
  return {.time_usec = static_cast<std::uint64_t>(time_ns / 1000), .zacc = -5, .fields_updated = 0x3f};
}

/// Some bytes of an attack; a frame or noise.
std::vector<std::uint8_t> attack(Random& random, std::int64_t now_ns) {
  std::vector<std::uint8_t> bytes;
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
      add(Timesync{.tc1 = 0, .ts1 = any_time(random, now_ns)}, from);
      break;
    case 3:
      add(Timesync{.tc1 = any_time(random, now_ns), .ts1 = any_time(random, now_ns)}, from);
      break;
    case 4:
      add(absurd_reading(random, now_ns), from);
      break;
    case 5:
      add(CommandAck{.command = 511, .result = static_cast<std::uint8_t>(random())}, from);
      break;
    case 6:
      add(Heartbeat{.type = static_cast<std::uint8_t>(random()), .autopilot = static_cast<std::uint8_t>(random())},
          Address{1, static_cast<std::uint8_t>(random())});
      break;
    case 7:
      add(false_reading(now_ns + kAhead_ns), stranger);
      break;
    case 8:
      add(false_reading(any_time(random, now_ns)), kController);
      break;
    default:
      add(Odometry{.time_usec = 5}, Address{});
      break;  // as if from ourselves
  }
  return bytes;
}

/// An honest flight controller on a line on which somebody else talks as well, as much as the line takes.
class AttackedController {
 public:
  explicit AttackedController(FakeLine& line) : line_(line) { line_.answer_timesync(kAhead_ns); }
  /// Once a millisecond.
  void step() {
    const std::int64_t now_ns = line_.now_ns();
    line_.peer.read();
    for (const Packet& packet : line_.peer.packets) {
      odometry += packet.id == Odometry::kId ? 1U : 0U;
      answers += packet.id == Timesync::kId ? 1U : 0U;
    }
    line_.peer.packets.clear();
    if (now_ns > next_heartbeat_ns_) {
      line_.peer.heartbeat();
      next_heartbeat_ns_ = now_ns + 500 * kMs;
    }
    if (now_ns > next_reading_ns_) {
      line_.peer.send(HighresImu{
          .time_usec = static_cast<std::uint64_t>((now_ns + kAhead_ns) / 1000), .zacc = -9.8F, .fields_updated = 0x3f});
      next_reading_ns_ = now_ns + 5 * kMs;
    }
    while (attacks && line_.peer.terminal->to_link.size() < kFull) {
      const std::vector<std::uint8_t> bytes = attack(random_, now_ns);
      line_.peer.send_bytes(bytes);
      attack_bytes += bytes.size();
    }
  }

  bool attacks = false;
  std::uint64_t attack_bytes = 0, odometry = 0, answers = 0;

 private:
  static constexpr std::size_t kFull = 2'000;  ///< bytes a millisecond: four times what the link takes

  FakeLine& line_;
  Random random_{1};
  std::int64_t next_heartbeat_ns_ = 0, next_reading_ns_ = 0;
};

TEST(MavlinkHostilePeer, MovesNothingAndStopsNothing) {
  LinkOnALine rig({}, ImuDeviceConfig{});
  rig.begin();
  FakeLine& line = rig.line;
  MavlinkLink& link = rig.link;
  AttackedController controller(line);
  std::uint64_t heap_calls = 0, lock_calls = 0, wrong_readings = 0, readings = 0;
  std::array<ImuSample, 64> samples;
  const auto run = [&](double seconds) {
    const std::int64_t until_ns = line.now_ns() + static_cast<std::int64_t>(1e9 * seconds);
    for (int i = 0; line.now_ns() < until_ns; ++i) {
      if (i % 5 == 0) rig.estimates.step(link, line.now_ns());
      controller.step();
      const std::uint64_t kernels = line.kernel.heap_calls, locks = lock_calls_of_this_thread();
      const HeapCallScope heap;
      rig.advance(kMs);
      std::size_t count = 0;
      link.read_imu(samples, count, Span{});
      heap_calls += heap.calls() - (line.kernel.heap_calls - kernels);
      lock_calls += lock_calls_of_this_thread() - locks;
      for (std::size_t k = 0; k < count; ++k, ++readings) {
        const double norm = std::hypot(samples[k].specific_force_m_s2[0], samples[k].specific_force_m_s2[1],
                                       samples[k].specific_force_m_s2[2]);
        wrong_readings += std::abs(norm - 9.8) > 0.01 ? 1U : 0U;
      }
    }
  };
  run(3);
  const LinkState before = link.state();
  ASSERT_GT(before.imu.readings, 0U);
  controller.attacks = true;
  controller.odometry = controller.answers = readings = 0;
  constexpr double kSeconds = 10;
  run(kSeconds);
  const LinkState state = link.state();
  EXPECT_GE(controller.odometry, 390U) << "40 a second";
  EXPECT_GE(readings, 300U) << "the link takes a quarter of what the line brings";
  EXPECT_GE(controller.attack_bytes, 3'000'000U);
  EXPECT_EQ(wrong_readings, 0U);
  // answers: to a hundred questions a second and a burst; among them our own questions to the flight controller
  EXPECT_LE(static_cast<double>(controller.answers), (100 + 10 + 20) * kSeconds + 40);
  EXPECT_EQ(state.peer.address.component, 1);
  EXPECT_EQ(state.clock.jumps, before.clock.jumps);
  EXPECT_LE(std::abs(state.clock.offset.ns + kAhead_ns), 5 * kMs);
  EXPECT_EQ(state.counts.disconnected, 0U);
  EXPECT_EQ(heap_calls, 0U);
  EXPECT_EQ(lock_calls, 0U);
  EXPECT_GT(state.counts.refused_questions + state.counts.refused_answers + state.counts.strangers, 0U);
}

/// A peer that sends as fast as anybody reads.
class FloodedSocket final : public test::FakeFile {
 public:
  short ready(std::int64_t /*now_ns*/) override { return POLLIN | POLLOUT; }
  ssize_t read(void* into, std::size_t /*size*/) override {
    if (is_opening) return is_opening = false, test::refuse(EAGAIN);
    return *static_cast<std::uint8_t*>(into) = 0, static_cast<ssize_t>(++times_read % 2);
  }
  ssize_t write(const void* from, std::size_t size) override {
    std::span<const std::uint8_t> bytes(static_cast<const std::uint8_t*>(from), size);
    while (const Packet* const packet = parser_.next(bytes)) odometry += packet->id == Odometry::kId ? 1U : 0U;
    return static_cast<ssize_t>(size);
  }
  bool is_opening = true;
  std::uint64_t times_read = 0, odometry = 0;

 private:
  Parser parser_;
};

// As many datagrams as a processor can send, empty ones and single bytes: the byte counts nothing, the reading does.
TEST(MavlinkHostilePeer, TinyDatagramsTakeNoProcessor) {
  test::FakeKernel kernel;
  const auto socket = std::make_shared<FloodedSocket>();
  kernel.make_socket = [&](int, int, int) { return socket; };
  MavlinkLink link(config_with(&MavlinkConfig::udp, "127.0.0.1:14550"), Mat3::Identity(), std::nullopt, 65, kernel);
  ASSERT_TRUE(link.begin());
  Estimates estimates;
  for (int i = 0; i < 400; ++i) {
    estimates.step(link, kernel.clock_ns);
    advance(kernel, link, 5 * kMs);
  }
  EXPECT_NEAR(static_cast<double>(socket->odometry), 80, 2) << "in 2 s";
  // 500 kB/s, each counted as 32 bytes at least, and what may come at once
  EXPECT_LE(link.state().counts.pieces, 15'625U * 2 + 1024);
  EXPECT_GE(link.state().counts.pieces, 15'625U * 2);
}

}  // namespace
}  // namespace epiline::mavlink
