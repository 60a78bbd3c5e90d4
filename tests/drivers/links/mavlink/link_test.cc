// The link over a made-up line, in its own time; and over pseudo terminals and sockets of this computer, where these
// are what is tested. Flight controllers' rules: docs/flight-controller.md.
#include "drivers/links/mavlink/link.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "drivers/links/mavlink/udp_port.h"
#include "platform/concurrency/lock_count.h"
#include "platform/memory/allocation_count.h"
#include "tests/drivers/links/mavlink/fake_line.h"

namespace epiline::mavlink {
namespace {

const Mat3 kForward = Mat3::Identity();
constexpr std::int64_t kLong = 20'000;  // ms: a busy computer

void open(MavlinkLink& link) {
  const Status status = link.open();
  ASSERT_TRUE(status) << status.error().text();
}
/// On a made-up line there is no thread.
void begin(MavlinkLink& link) {
  const Status status = link.begin();
  ASSERT_TRUE(status) << status.error().text();
}
MavlinkLink link_on(FakeLine& line, const MavlinkConfig& config = serial_config(FakeLine::path())) {
  return {config, kForward, std::nullopt, 65, line.kernel};
}

std::string error_of(const MavlinkConfig& config) {
  MavlinkLink link(config, kForward);
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
  config = {};
  config.serial = "/dev/null";
  config.frame = 1;
  EXPECT_NE(error_of(config).find("mavlink.frame: local-ned without mavlink.heading_deg"), std::string::npos);
  config.frame = 0;
  EXPECT_EQ(error_of(config), "/dev/null: Inappropriate ioctl for device [TCGETS2]; expected a serial device");
}

TEST(MavlinkLink, HasTheLineAlone) {
  PseudoTerminal line;
  MavlinkLink link(serial_config(line.path()), kForward);
  open(link);
  const std::string error = error_of(serial_config(line.path()));
  EXPECT_NE(error.find("expected a port that no other program has open"), std::string::npos) << error;
  link.close();
  EXPECT_EQ(error_of(serial_config(line.path())), "");
}

TEST(MavlinkLink, SendsHeartbeatsWithoutAnEstimate) {
  FakeLine line;
  MavlinkLink link = link_on(line);
  begin(link);
  ASSERT_TRUE(wait_for(line, link, kLong, [&] { return line.peer.all<Heartbeat>().size() >= 2; }));
  const auto heartbeats = line.peer.all<Heartbeat>();
  EXPECT_EQ(heartbeats[0].type, 18);
  EXPECT_EQ(heartbeats[0].autopilot, 8);
  EXPECT_EQ(heartbeats[0].system_status, 3);  // standby
  EXPECT_TRUE(line.peer.all<Odometry>().empty());
  ASSERT_EQ(line.peer.all<StatusText>().size(), 1U);
  EXPECT_STREQ(line.peer.all<StatusText>()[0].text.data(), "VIO starting, no position yet");
  EXPECT_EQ(line.peer.packets[0].from.system, 1);
  EXPECT_EQ(line.peer.packets[0].from.component, 197);
}

/// Stamps rise, none is repeated, and each is one that was published.
void expect_rising(const std::vector<Odometry>& messages) {
  for (std::size_t i = 1; i < messages.size(); ++i) ASSERT_GT(messages[i].time_usec, messages[i - 1].time_usec);
}

TEST(MavlinkLink, SendsOdometryAtItsRate) {
  FakeLine line;
  MavlinkLink link = link_on(line);
  begin(link);
  Estimates estimates;
  const std::int64_t begin_ns = line.now_ns();
  ASSERT_TRUE(fly(line, link, estimates, kLong, [&] { return line.peer.all<Odometry>().size() >= 80; }));
  const double seconds = 1e-9 * static_cast<double>(line.now_ns() - begin_ns);
  EXPECT_EQ(line.peer.all<Heartbeat>().back().system_status, 4);  // active
  advance(line.kernel, link, 1'100 * kMs);                        // the latency is told each second
  line.peer.read();
  const auto messages = line.peer.all<Odometry>();
  expect_rising(messages);
  EXPECT_LE(static_cast<double>(messages.size()), 1.1 * 40 * seconds + 1);
  const Odometry& last = messages.back();
  EXPECT_EQ(last.frame_id, 20);
  EXPECT_EQ(last.child_frame_id, 12);
  EXPECT_EQ(last.estimator_type, 3);
  EXPECT_EQ(last.quality, 90);
  EXPECT_FLOAT_EQ(last.pose_covariance[0], 1e-4F);
  EXPECT_NEAR(last.x, 1e-6 * static_cast<double>(last.time_usec % 1'000'000'000), 1e-2);
  const LinkState state = link.state();
  EXPECT_EQ(state.counts.odometry, messages.size());
  EXPECT_EQ(state.counts.disconnected, 0U);
  EXPECT_EQ(line.peer.parser().skipped_bytes(), 0U);
  // each image's way is measured once; what came last may not have left
  EXPECT_GE(link.latency().count() + 2, static_cast<std::uint64_t>(estimates.images));
  EXPECT_LE(link.latency().count(), static_cast<std::uint64_t>(estimates.images));
  EXPECT_GE(link.latency().quantile_ns(0.01), 2 * kMs);  // images are 2 ms old when they are handed over
}

TEST(MavlinkLink, SendsPositionsToThoseWhoTakeNoOdometry) {
  FakeLine line;
  MavlinkConfig config = serial_config(line.path());
  config.message = 1;
  MavlinkLink link = link_on(line, config);
  begin(link);
  Estimates estimates;
  ASSERT_TRUE(fly(line, link, estimates, kLong, [&] { return line.peer.all<Heartbeat>().size() >= 3; }));
  EXPECT_TRUE(line.peer.all<VisionPositionEstimate>().empty()) << "it is not known yet who would take them for what";
  line.peer.send(Heartbeat{.type = 2, .autopilot = 3});
  ASSERT_TRUE(fly(line, link, estimates, kLong, [&] { return line.peer.all<VisionPositionEstimate>().size() >= 5; }));
  EXPECT_TRUE(line.peer.all<Odometry>().empty());
}

// The publisher hands out the last prediction again while the IMU is silent: that is no new pose.
TEST(MavlinkLink, NeverRepeatsAPose) {
  FakeLine line;
  MavlinkLink link = link_on(line);
  begin(link);
  Estimates estimates;
  ASSERT_TRUE(fly(line, link, estimates, kLong, [&] { return line.peer.all<Odometry>().size() >= 5; }));
  estimates.odometry.health = {HealthState::kDegraded, bit(HealthReason::kImuSilent), 10};
  const std::size_t before = line.peer.all<Odometry>().size();
  ASSERT_TRUE(wait_for(line, link, kLong, [&] {
    link.publish(estimates.odometry);
    return line.peer.all<StatusText>().size() >= 2;
  }));
  expect_rising(line.peer.all<Odometry>());
  EXPECT_LE(line.peer.all<Odometry>().size(), before + 2);  // the last one, if it had not been sent; and one on its way
}

TEST(MavlinkLink, StopsWhenLostAndSaysSo) {
  FakeLine line;
  MavlinkLink link = link_on(line);
  begin(link);
  Estimates estimates;
  const auto has_text = [&](const char* text) {
    const auto texts = line.peer.all<StatusText>();
    return std::any_of(texts.begin(), texts.end(),
                       [&](const StatusText& t) { return std::string(t.text.data()) == text; });
  };
  ASSERT_TRUE(fly(line, link, estimates, kLong, [&] { return has_text("VIO ok"); }));
  const int counter = line.peer.all<Odometry>().back().reset_counter;
  estimates.odometry.health = {HealthState::kLost, bit(HealthReason::kCameraSilent), -1};
  ASSERT_TRUE(fly(line, link, estimates, kLong, [&] { return has_text("VIO lost, stopped: no camera images"); }));
  const std::size_t sent = line.peer.all<Odometry>().size();
  ASSERT_TRUE(fly(line, link, estimates, kLong, [&] { return line.peer.all<Heartbeat>().back().system_status == 5; }));
  EXPECT_EQ(line.peer.all<Odometry>().size(), sent);
  estimates.odometry.health = {HealthState::kTracking, 0, 70};
  ASSERT_TRUE(fly(line, link, estimates, kLong, [&] { return has_text("VIO ok again, position was reset"); }));
  EXPECT_EQ(line.peer.all<Odometry>().back().reset_counter, (counter + 1) % 256);
  for (const Odometry& message : line.peer.all<Odometry>()) EXPECT_GE(message.quality, 1);
  // nobody publishes any more
  ASSERT_TRUE(wait_for(line, link, kLong, [&] { return has_text("VIO stopped: no estimate"); }));
  // somebody does again: the pilot is told of a reset, and so is the flight controller
  const std::size_t before = line.peer.all<Odometry>().size();
  ASSERT_TRUE(fly(line, link, estimates, kLong, [&] { return line.peer.all<Odometry>().size() > before + 5; }));
  EXPECT_EQ(line.peer.all<Odometry>().back().reset_counter, (counter + 2) % 256);
}

TEST(MavlinkLink, AnswersTimesyncAndLearnsTheClock) {
  FakeLine line;
  MavlinkLink link = link_on(line);
  begin(link);
  constexpr std::int64_t kFutureBy_ns = 1'000'000 * kMs;
  line.peer.on_packet = [&](const Packet& packet) {
    Timesync question;
    if (unpack(packet, question) && question.tc1 == 0)
      line.peer.send(Timesync{.tc1 = line.now_ns() + kFutureBy_ns, .ts1 = question.ts1});
  };
  line.peer.heartbeat();
  line.peer.send(Timesync{.tc1 = 0, .ts1 = 424242});
  ASSERT_TRUE(wait_for(line, link, kLong, [&] { return link.clock_state().used >= 1; }));
  const auto all = line.peer.all<Timesync>();
  const auto answer = std::find_if(all.begin(), all.end(), [](const Timesync& t) { return t.ts1 == 424242; });
  ASSERT_NE(answer, all.end());
  EXPECT_GT(answer->tc1, line.now_ns() - 60'000 * kMs);
  EXPECT_LT(answer->tc1, line.now_ns());
  const LinkState state = link.state();
  EXPECT_LE(std::abs(state.clock.offset.ns + kFutureBy_ns), 5 * kMs);
  EXPECT_TRUE(state.peer.is_known);
  EXPECT_EQ(state.peer.autopilot, 12);
}

TEST(MavlinkLink, TakesOnlyItsOwnVehicleForAController) {
  FakeLine line;
  MavlinkLink link = link_on(line);
  begin(link);
  line.peer.heartbeat({2, 1});                                      // another vehicle
  line.peer.send(Heartbeat{.type = 6, .autopilot = 3}, {1, 190});   // a ground station
  line.peer.send(Heartbeat{.type = 18, .autopilot = 8}, {1, 191});  // another computer on board
  line.peer.heartbeat({1, 1});
  line.peer.heartbeat({1, 55});  // somebody who claims to be it
  ASSERT_TRUE(wait_for(line, link, kLong, [&] { return link.counts().packets >= 5; }));
  EXPECT_TRUE(link.state().peer.is_known);
  EXPECT_EQ(link.state().peer.address.component, 1);
  EXPECT_EQ(link.counts().strangers, 1U);
}

// Cameras and gimbals that claim an autopilot: mavlink-camera-manager#105.
TEST(MavlinkLink, ACameraIsNoControllerWhileOneIsThere) {
  FakeLine line;
  MavlinkLink link = link_on(line);
  begin(link);
  const auto a_second_with_the_camera = [&] {
    line.peer.send(Heartbeat{.type = 30, .autopilot = 3}, {1, 100});
    wait_for(line, link, 1'000, [] { return false; });
  };
  a_second_with_the_camera();
  EXPECT_FALSE(link.state().peer.is_known);
  line.peer.heartbeat();
  a_second_with_the_camera();
  EXPECT_EQ(link.state().peer.address.component, 1);
  for (int i = 0; i < 7; ++i) a_second_with_the_camera();  // the controller restarts
  EXPECT_EQ(link.state().peer.address.component, 1);
  EXPECT_EQ(link.counts().strangers, 0U) << "a camera is no fault";
}

TEST(MavlinkLink, WithoutAControllerWhatClaimsToBeOneIsTakenUntilOneComes) {
  FakeLine line;
  MavlinkLink link = link_on(line);
  begin(link);
  for (int i = 0; i < 5; ++i) {
    line.peer.heartbeat({1, 7});
    wait_for(line, link, 1'000, [] { return false; });
  }
  EXPECT_EQ(link.state().peer.address.component, 7);
  line.peer.heartbeat();
  wait_for(line, link, 100, [] { return false; });
  EXPECT_EQ(link.state().peer.address.component, 1);
}

// Until there is an answer nobody gives: ArduPilot leaves it at the first, and forgets it when it starts anew.
TEST(MavlinkLink, TellsAnArduPilotWhereItIs) {
  FakeLine line;
  MavlinkConfig config = serial_config(line.path());
  config.origin_latitude_deg = 47.397742;
  config.origin_longitude_deg = -8.545594;
  config.origin_altitude_m = 488.1;
  MavlinkLink link = link_on(line, config);
  begin(link);
  const auto origins = [&] { return line.peer.all<SetGpsGlobalOrigin>(); };
  line.peer.heartbeat();  // PX4
  ASSERT_TRUE(wait_for(line, link, kLong, [&] { return line.peer.all<Timesync>().size() >= 2; }));
  EXPECT_TRUE(origins().empty());
  line.peer.send(Heartbeat{.type = 2, .autopilot = 3});
  ASSERT_TRUE(wait_for(line, link, kLong, [&] { return origins().size() >= 2; }));
  EXPECT_EQ(origins()[0].latitude, 473977420);
  EXPECT_EQ(origins()[0].longitude, -85455940);
  EXPECT_EQ(origins()[0].altitude, 488100);
  EXPECT_EQ(origins()[0].target_system, 1);
  EXPECT_EQ(origins()[1].latitude, 473977420);
  EXPECT_EQ(link.counts().origins, origins().size());
}

TEST(MavlinkLink, TellsNobodyAnOriginThatIsNotSet) {
  FakeLine line;
  MavlinkLink link = link_on(line);
  begin(link);
  line.peer.send(Heartbeat{.type = 2, .autopilot = 3});
  ASSERT_TRUE(wait_for(line, link, kLong, [&] { return line.peer.all<Timesync>().size() >= 2; }));
  EXPECT_TRUE(line.peer.all<SetGpsGlobalOrigin>().empty());
}

TEST(MavlinkLink, ComesBackAfterTheLineWasUnplugged) {
  FakeLine line;
  MavlinkLink link = link_on(line);
  begin(link);
  Estimates estimates;
  for (int round = 0; round < 3; ++round) {
    SCOPED_TRACE(round);
    line.peer.packets.clear();
    EXPECT_TRUE(link.publish_image(estimates.odometry));
    EXPECT_TRUE(link.publish(estimates.odometry));
    ASSERT_TRUE(fly(line, link, estimates, kLong, [&] { return line.peer.all<Odometry>().size() >= 5; }));
    line.unplug();
    ASSERT_TRUE(fly(line, link, estimates, kLong, [&] { return !link.state().is_open; }));
    EXPECT_FALSE(link.publish_image(estimates.odometry));
    EXPECT_FALSE(link.publish(estimates.odometry));
    ASSERT_TRUE(
        fly(line, link, estimates, kLong, [&, n = link.counts().retries] { return link.counts().retries > n; }));
    line.plug_in();
    ASSERT_TRUE(fly(line, link, estimates, kLong, [&] { return link.state().is_open; }));
  }
  line.peer.packets.clear();
  ASSERT_TRUE(fly(line, link, estimates, kLong, [&] { return line.peer.all<Odometry>().size() >= 5; }));
  EXPECT_EQ(link.counts().disconnected, 3U);
  EXPECT_GT(link.counts().dropped, 0U);
}

TEST(MavlinkLink, TriesALostLineAtGrowingIntervals) {
  FakeLine line;
  MavlinkLink link = link_on(line);
  begin(link);
  advance(line.kernel, link, 2'000 * kMs);
  line.unplug();
  advance(line.kernel, link, 5'000 * kMs);
  // after 50, 100, 200, 400 ms, then each 500 ms
  EXPECT_EQ(link.counts().retries, 12U);
  EXPECT_EQ(link.counts().last_error, ENOENT);
  EXPECT_EQ(line.kernel.open_files(), 1U) << "only what wakes the thread";
  // one that opens and fails at once is not tried in a hurry
  line.plug_in();
  advance(line.kernel, link, 500 * kMs);
  EXPECT_TRUE(link.state().is_open);
  line.unplug();
  advance(line.kernel, link, 450 * kMs);
  EXPECT_EQ(link.counts().retries, 12U);
  EXPECT_EQ(link.counts().disconnected, 2U);
}

// A reader that is too slow gets fewer messages, never older ones behind newer ones.
TEST(MavlinkLink, AFullLineCostsMessagesNotOrder) {
  FakeLine line;
  MavlinkConfig config = serial_config(line.path());
  config.rate_hz = 100;
  MavlinkLink link = link_on(line, config);
  begin(link);
  Estimates estimates;
  const std::int64_t until_ns = line.now_ns() + kLong * kMs;
  while (link.counts().dropped == 0 && line.now_ns() < until_ns) {  // nobody reads: the line fills
    estimates.step(link, line.now_ns());
    advance(line.kernel, link, kMs);
  }
  ASSERT_GT(link.counts().dropped, 0U);
  ASSERT_TRUE(
      fly(line, link, estimates, kLong, [&, n = link.counts().odometry] { return link.counts().odometry > n + 20; }));
  expect_rising(line.peer.all<Odometry>());
  EXPECT_EQ(line.peer.parser().bad_checksums(), 0U);
}

// The kernel's queue would take seconds of odometry: it would arrive old.
TEST(MavlinkLink, ASlowLineGetsNoOdometryThatWouldWait) {
  FakeLine line;
  MavlinkLink link = link_on(line);
  begin(link);
  Estimates estimates;
  ASSERT_TRUE(fly(line, link, estimates, kLong, [&] { return line.peer.all<Odometry>().size() >= 10; }));
  EXPECT_EQ(link.counts().dropped, 0U);
  line.peer.terminal->queued = 1'000;
  fly(line, link, estimates, 100, [] { return false; });
  const std::size_t before = line.peer.all<Odometry>().size();
  fly(line, link, estimates, 1'000, [] { return false; });
  EXPECT_EQ(line.peer.all<Odometry>().size(), before);
  EXPECT_GT(link.counts().dropped, 20U) << "of 40 a second";
  line.peer.terminal->queued = 0;
  ASSERT_TRUE(fly(line, link, estimates, kLong, [&] { return line.peer.all<Odometry>().size() >= before + 10; }));
  expect_rising(line.peer.all<Odometry>());
}

/// Age of a flight controller's reading when it arrives, by its timestamp.
Span age_of_reading(double delay_ms) {
  FakeLine line;
  ImuDeviceConfig imu;
  imu.delay_ms = delay_ms;
  MavlinkLink link(serial_config(line.path()), kForward, imu, 65, line.kernel);
  begin(link);
  line.peer.on_packet = [&](const Packet& packet) {
    Timesync question;
    if (unpack(packet, question) && question.tc1 == 0)
      line.peer.send(Timesync{.tc1 = line.now_ns(), .ts1 = question.ts1});
  };
  line.peer.heartbeat();
  EXPECT_TRUE(wait_for(line, link, kLong, [&] { return link.clock_state().used >= 20; }));
  std::array<ImuSample, 1> sample;
  std::size_t count = 0;
  EXPECT_EQ(link.read_imu(sample, count, Span{}), ReadOutcome::kTimeout);
  line.peer.send(HighresImu{
      .time_usec = static_cast<std::uint64_t>(line.now_ns() / 1000), .zacc = -9.81F, .fields_updated = 0x3f});
  advance(line.kernel, link, 5 * kMs);
  EXPECT_EQ(link.read_imu(sample, count, Span{}), ReadOutcome::kSample);
  return sample[0].arrival - sample[0].stamp;
}

TEST(MavlinkLink, TakesTheDelayOfReadingsOff) { EXPECT_EQ((age_of_reading(3) - age_of_reading(0)).ns, 3 * kMs); }

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
/// Answers go to whoever spoke last, and that must be the link.
sockaddr_in address_of_sender(int fd) {
  sockaddr_in from{};
  socklen_t length = sizeof from;
  std::uint8_t byte = 0;
  pollfd wait{fd, POLLIN, 0};
  EXPECT_EQ(::poll(&wait, 1, static_cast<int>(kLong)), 1);
  ::recvfrom(fd, &byte, 1, 0, reinterpret_cast<sockaddr*>(&from), &length);
  return from;
}

TEST(MavlinkLink, SpeaksByDatagramsWithItsPeerAlone) {
  std::string address;
  Peer peer(bound_socket(address));
  MavlinkConfig config;
  config.udp = address;
  MavlinkLink link(config, kForward);
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
  ASSERT_TRUE(fly(link, estimates, peer, kLong,
                  [&] { return peer.all<Odometry>().size() >= 10 && link.state().peer.is_known; }));
  EXPECT_EQ(link.state().peer.address.component, 1);
  EXPECT_EQ(link.counts().packets, 1U);
  stranger.read();
  EXPECT_TRUE(stranger.packets.empty());
}

TEST(MavlinkLink, WaitsForAPeerThatIsNotThere) {
  std::string address;
  Peer peer(bound_socket(address));
  MavlinkConfig config;
  config.udp = address;
  peer.hang_up();
  MavlinkLink link(config, kForward);
  open(link);
  Estimates estimates;
  ASSERT_TRUE(fly(link, estimates, peer, kLong, [&] { return link.counts().write_errors > 0; }));
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
  MavlinkLink link(serial_config(line.path()), kForward);
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
