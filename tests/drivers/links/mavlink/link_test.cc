// The link over a made-up line, in its own time. Flight controllers' rules: docs/flight-controller.md. Its settings,
// and the ports of this computer: link_ports_test.cc.
#include "drivers/links/mavlink/link.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "tests/drivers/links/mavlink/fake_line.h"

namespace epiline::mavlink {
namespace {

class BegunLink : public testing::Test, protected LinkOnALine {
 protected:
  void SetUp() override { begin(); }
};

TEST_F(BegunLink, SendsHeartbeatsWithoutAnEstimate) {
  ASSERT_TRUE(wait_for([&] { return sent<Heartbeat>().size() >= 2; }));
  const auto heartbeats = sent<Heartbeat>();
  EXPECT_EQ(heartbeats[0].type, 18);
  EXPECT_EQ(heartbeats[0].autopilot, 8);
  EXPECT_EQ(heartbeats[0].system_status, 3);  // standby
  EXPECT_TRUE(sent<Odometry>().empty());
  ASSERT_EQ(sent<StatusText>().size(), 1U);
  EXPECT_STREQ(sent<StatusText>()[0].text.data(), "VIO starting, no position yet");
  EXPECT_EQ(line.peer.packets[0].from.system, 1);
  EXPECT_EQ(line.peer.packets[0].from.component, 197);
}

/// Stamps rise, none is repeated, and each is one that was published.
void expect_rising(const std::vector<Odometry>& messages) {
  for (std::size_t i = 1; i < messages.size(); ++i) ASSERT_GT(messages[i].time_usec, messages[i - 1].time_usec);
}

TEST_F(BegunLink, SendsOdometryAtItsRate) {
  const std::int64_t begin_ns = line.now_ns();
  ASSERT_TRUE(fly([&] { return sent<Odometry>().size() >= 80; }));
  const double seconds = 1e-9 * static_cast<double>(line.now_ns() - begin_ns);
  EXPECT_EQ(sent<Heartbeat>().back().system_status, 4);  // active
  advance(1'100 * kMs);                                  // the link reports the latency each second
  line.peer.read();
  const auto messages = sent<Odometry>();
  expect_rising(messages);
  EXPECT_LE(static_cast<double>(messages.size()), 1.1 * 40 * seconds + 1);
  const Odometry& last = messages.back();
  EXPECT_EQ(last.quality, 90);
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
  LinkOnALine rig(config_with(&MavlinkConfig::message, 1));
  rig.begin();
  ASSERT_TRUE(rig.fly([&] { return rig.sent<Heartbeat>().size() >= 3; }));
  EXPECT_TRUE(rig.sent<VisionPositionEstimate>().empty()) << "it is not known yet who would take them for what";
  rig.line.peer.send(Heartbeat{.type = 2, .autopilot = 3});
  ASSERT_TRUE(rig.fly([&] { return rig.sent<VisionPositionEstimate>().size() >= 5; }));
  EXPECT_TRUE(rig.sent<Odometry>().empty());
}

TEST_F(BegunLink, StopsWhenLostAndSaysSo) {
  const auto has_text = [&](const char* text) {
    const auto texts = sent<StatusText>();
    return std::any_of(texts.begin(), texts.end(),
                       [&](const StatusText& t) { return std::string(t.text.data()) == text; });
  };
  ASSERT_TRUE(fly([&] { return has_text("VIO ok"); }));
  const int counter = sent<Odometry>().back().reset_counter;
  estimates.odometry.health = {HealthState::kLost, bit(HealthReason::kCameraSilent), -1};
  ASSERT_TRUE(fly([&] { return has_text("VIO lost, stopped: no camera images"); }));
  const std::size_t before_loss = sent<Odometry>().size();
  ASSERT_TRUE(fly([&] { return sent<Heartbeat>().back().system_status == 5; }));
  EXPECT_EQ(sent<Odometry>().size(), before_loss);
  estimates.odometry.health = {HealthState::kTracking, 0, 70};
  ASSERT_TRUE(fly([&] { return has_text("VIO ok again, position was reset"); }));
  EXPECT_EQ(sent<Odometry>().back().reset_counter, (counter + 1) % 256);
  for (const Odometry& message : sent<Odometry>()) EXPECT_GE(message.quality, 1);
  // nobody publishes any more
  ASSERT_TRUE(wait_for([&] { return has_text("VIO stopped: no estimate"); }));
  // somebody does again: the pilot hears of a reset, and so does the flight controller
  const std::size_t before = sent<Odometry>().size();
  ASSERT_TRUE(fly([&] { return sent<Odometry>().size() > before + 5; }));
  EXPECT_EQ(sent<Odometry>().back().reset_counter, (counter + 2) % 256);
}

TEST_F(BegunLink, AnswersTimesyncAndLearnsTheClock) {
  constexpr std::int64_t kFutureBy_ns = 1'000'000 * kMs;
  line.answer_timesync(kFutureBy_ns);
  line.peer.heartbeat();
  line.peer.send(Timesync{.tc1 = 0, .ts1 = 424242});
  ASSERT_TRUE(wait_for([&] { return link.clock_state().used >= 1; }));
  const auto all = sent<Timesync>();
  const auto answer = std::find_if(all.begin(), all.end(), [](const Timesync& t) { return t.ts1 == 424242; });
  ASSERT_NE(answer, all.end());
  EXPECT_GT(answer->tc1, line.now_ns() - 60'000 * kMs);
  EXPECT_LT(answer->tc1, line.now_ns());
  const LinkState state = link.state();
  EXPECT_LE(std::abs(state.clock.offset.ns + kFutureBy_ns), 5 * kMs);
  EXPECT_TRUE(state.peer.is_known);
  EXPECT_EQ(state.peer.autopilot, 12);
}

TEST_F(BegunLink, TakesOnlyItsOwnVehicleForAController) {
  line.peer.heartbeat({2, 1});                                      // another vehicle
  line.peer.send(Heartbeat{.type = 6, .autopilot = 3}, {1, 190});   // a ground station
  line.peer.send(Heartbeat{.type = 18, .autopilot = 8}, {1, 191});  // another computer on board
  line.peer.heartbeat({1, 1});
  line.peer.heartbeat({1, 55});  // somebody who claims to be it
  ASSERT_TRUE(wait_for([&] { return link.counts().packets >= 5; }));
  EXPECT_TRUE(link.state().peer.is_known);
  EXPECT_EQ(link.state().peer.address.component, 1);
  EXPECT_EQ(link.counts().strangers, 1U);
}

// Cameras and gimbals that claim an autopilot: mavlink-camera-manager#105.
TEST_F(BegunLink, ACameraIsNoControllerWhileOneIsThere) {
  const auto a_second_with_the_camera = [&] {
    line.peer.send(Heartbeat{.type = 30, .autopilot = 3}, {1, 100});
    wait_ms(1'000);
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

TEST_F(BegunLink, WithoutAControllerWhatClaimsToBeOneIsTakenUntilOneComes) {
  for (int i = 0; i < 5; ++i) {
    line.peer.heartbeat({1, 7});
    wait_ms(1'000);
  }
  EXPECT_EQ(link.state().peer.address.component, 7);
  line.peer.heartbeat();
  wait_ms(100);
  EXPECT_EQ(link.state().peer.address.component, 1);
}

// Until there is an answer nobody gives: ArduPilot leaves it at the first, and forgets it when it starts anew.
TEST(MavlinkLink, TellsAnArduPilotWhereItIs) {
  LinkOnALine rig(config_with(&MavlinkConfig::origin, {47.397742, -8.545594, 488.1}));
  rig.begin();
  const auto origins = [&] { return rig.sent<SetGpsGlobalOrigin>(); };
  rig.line.peer.heartbeat();  // PX4
  ASSERT_TRUE(rig.wait_for([&] { return rig.sent<Timesync>().size() >= 2; }));
  EXPECT_TRUE(origins().empty());
  rig.line.peer.send(Heartbeat{.type = 2, .autopilot = 3});
  ASSERT_TRUE(rig.wait_for([&] { return origins().size() >= 2; }));
  EXPECT_EQ(origins()[0].latitude, 473977420);
  EXPECT_EQ(origins()[0].longitude, -85455940);
  EXPECT_EQ(origins()[0].altitude, 488100);
  EXPECT_EQ(origins()[0].target_system, 1);
  EXPECT_EQ(origins()[1].latitude, 473977420);
  EXPECT_EQ(rig.link.counts().origins, origins().size());
}

TEST_F(BegunLink, TellsNobodyAnOriginThatIsNotSet) {
  line.peer.send(Heartbeat{.type = 2, .autopilot = 3});
  ASSERT_TRUE(wait_for([&] { return sent<Timesync>().size() >= 2; }));
  EXPECT_TRUE(sent<SetGpsGlobalOrigin>().empty());
}

TEST_F(BegunLink, ComesBackAfterTheLineWasUnplugged) {
  for (int round = 0; round < 3; ++round) {
    SCOPED_TRACE(round);
    line.peer.packets.clear();
    EXPECT_TRUE(link.publish_image(estimates.odometry));
    EXPECT_TRUE(link.publish(estimates.odometry));
    ASSERT_TRUE(fly([&] { return sent<Odometry>().size() >= 5; }));
    line.unplug();
    ASSERT_TRUE(fly([&] { return !link.state().is_open; }));
    EXPECT_FALSE(link.publish_image(estimates.odometry));
    EXPECT_FALSE(link.publish(estimates.odometry));
    ASSERT_TRUE(fly([&, n = link.counts().retries] { return link.counts().retries > n; }));
    line.plug_in();
    ASSERT_TRUE(fly([&] { return link.state().is_open; }));
  }
  line.peer.packets.clear();
  ASSERT_TRUE(fly([&] { return sent<Odometry>().size() >= 5; }));
  EXPECT_EQ(link.counts().disconnected, 3U);
  EXPECT_GT(link.counts().dropped, 0U);
}

TEST_F(BegunLink, TriesALostLineAtGrowingIntervals) {
  advance(2'000 * kMs);
  line.unplug();
  advance(5'000 * kMs);
  // after 50, 100, 200, 400 ms, then each 500 ms
  EXPECT_EQ(link.counts().retries, 12U);
  EXPECT_EQ(link.counts().last_error, ENOENT);
  EXPECT_EQ(line.kernel.open_files(), 1U) << "only what wakes the thread";
  // one that opens and fails at once is not tried in a hurry
  line.plug_in();
  advance(500 * kMs);
  EXPECT_TRUE(link.state().is_open);
  line.unplug();
  advance(450 * kMs);
  EXPECT_EQ(link.counts().retries, 12U);
  EXPECT_EQ(link.counts().disconnected, 2U);
}

// A reader that is too slow gets fewer messages, never older ones behind newer ones.
TEST_F(BegunLink, AFullLineCostsMessagesNotOrder) {
  const std::int64_t until_ns = line.now_ns() + kPatience_ms * kMs;
  while (link.counts().dropped == 0 && line.now_ns() < until_ns) {  // nobody reads: the line fills
    estimates.step(link, line.now_ns());
    advance(5 * kMs);
  }
  ASSERT_GT(link.counts().dropped, 0U);
  ASSERT_TRUE(fly([&, n = link.counts().odometry] { return link.counts().odometry > n + 20; }));
  expect_rising(sent<Odometry>());
  EXPECT_EQ(line.peer.parser().bad_checksums(), 0U);
}

// The kernel's queue would take seconds of odometry: it would arrive old.
TEST_F(BegunLink, ASlowLineGetsNoOdometryThatWouldWait) {
  ASSERT_TRUE(fly([&] { return sent<Odometry>().size() >= 10; }));
  EXPECT_EQ(link.counts().dropped, 0U);
  line.peer.terminal->queued = 1'000;
  fly_for(100);
  const std::size_t before = sent<Odometry>().size();
  fly_for(1'000);
  EXPECT_EQ(sent<Odometry>().size(), before);
  EXPECT_GT(link.counts().dropped, 20U) << "of 40 a second";
  line.peer.terminal->queued = 0;
  ASSERT_TRUE(fly([&] { return sent<Odometry>().size() >= before + 10; }));
  expect_rising(sent<Odometry>());
}

/// Age of a flight controller's reading when it arrives, by its timestamp.
Span age_of_reading(double delay_ms) {
  LinkOnALine rig({}, config_with(&ImuDeviceConfig::delay_ms, delay_ms));
  rig.begin();
  rig.line.answer_timesync();
  rig.line.peer.heartbeat();
  EXPECT_TRUE(rig.wait_for([&] { return rig.link.clock_state().used >= 20; }));
  std::array<ImuSample, 1> sample;
  std::size_t count = 0;
  EXPECT_EQ(rig.link.read_imu(sample, count, Span{}), ReadOutcome::kTimeout);
  rig.line.peer.send(HighresImu{
      .time_usec = static_cast<std::uint64_t>(rig.line.now_ns() / 1000), .zacc = -9.81F, .fields_updated = 0x3f});
  rig.advance(5 * kMs);
  EXPECT_EQ(rig.link.read_imu(sample, count, Span{}), ReadOutcome::kSample);
  return sample[0].arrival - sample[0].stamp;
}

TEST(MavlinkLink, TakesTheDelayOfReadingsOff) { EXPECT_EQ((age_of_reading(3) - age_of_reading(0)).ns, 3 * kMs); }

}  // namespace
}  // namespace epiline::mavlink
