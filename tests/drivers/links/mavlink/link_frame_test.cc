// In which frame the link sends poses, and to which flight controller not.
#include <gtest/gtest.h>

#include "drivers/links/mavlink/link.h"
#include "tests/drivers/links/mavlink/fake_line.h"

namespace epiline::mavlink {
namespace {

constexpr std::int64_t kAWhile = 20'000;  // ms

/// Whether the link sends what `config` asks for to that autopilot; it says why not.
std::string refusal_of(MavlinkConfig config, std::uint8_t autopilot) {
  FakeLine line;
  config.serial = line.path();
  MavlinkLink link(config, Mat3::Identity(), std::nullopt, 65, line.kernel);
  EXPECT_TRUE(link.begin());
  Estimates estimates;
  line.peer.send(Heartbeat{.type = 2, .autopilot = autopilot});
  EXPECT_TRUE(wait_for(line, link, kAWhile, [&] { return link.state().peer.is_known; }));
  EXPECT_TRUE(fly(line, link, estimates, kAWhile, [&] { return line.peer.all<Heartbeat>().size() >= 3; }));
  const bool sends = !line.peer.all<Odometry>().empty() || !line.peer.all<VisionPositionEstimate>().empty();
  EXPECT_EQ(sends, link.state().refusal == Refusal::kNone);
  EXPECT_EQ(link.counts().dropped, 0U);
  const auto texts = line.peer.all<StatusText>();
  EXPECT_EQ(std::string(texts.back().text.data()), sends ? "VIO ok" : "VIO not sent: see mavlink.frame of epiline");
  return sentence_of(link.state().refusal);
}

// PX4 takes VISION_POSITION_ESTIMATE for a pose to true north; ArduPilot takes ODOMETRY in LOCAL_FRD alone.
TEST(MavlinkLink, RefusesWhatTheControllerWouldMisunderstand) {
  MavlinkConfig odometry, north, position, position_north;
  north.frame = position_north.frame = 1;
  north.heading_deg = position_north.heading_deg = 0;
  position.message = position_north.message = 1;
  EXPECT_EQ(refusal_of(odometry, kPx4), "");
  EXPECT_EQ(refusal_of(odometry, kArduPilot), "");
  EXPECT_EQ(refusal_of(north, kPx4), "");
  EXPECT_EQ(refusal_of(north, kArduPilot),
            "ArduPilot ignores ODOMETRY in mavlink.frame = \"local-ned\": odometry is not sent");
  EXPECT_EQ(refusal_of(position, kPx4),
            "PX4 takes mavlink.message = \"vision-position\" for a pose to true north: odometry is not sent");
  EXPECT_EQ(refusal_of(position, kArduPilot), "");
  EXPECT_EQ(refusal_of(position_north, kPx4), "");
  EXPECT_EQ(refusal_of(position_north, kArduPilot), "");
}

TEST(MavlinkLink, SendsToTheNorth) {
  FakeLine line;
  MavlinkConfig config = serial_config(line.path());
  config.frame = 1;
  config.heading_deg = 90;
  MavlinkLink link(config, Mat3::Identity(), std::nullopt, 65, line.kernel);
  EXPECT_TRUE(link.begin());
  Estimates estimates;
  ASSERT_TRUE(fly(line, link, estimates, kAWhile, [&] { return line.peer.all<Odometry>().size() >= 5; }));
  const Odometry last = line.peer.all<Odometry>().back();
  EXPECT_EQ(last.frame_id, 1);
  EXPECT_NEAR(last.x, 0, 1e-3);  // ahead is east
  EXPECT_NEAR(last.y, 1e-6 * static_cast<double>(last.time_usec % 1'000'000'000), 1e-2);
}

}  // namespace
}  // namespace epiline::mavlink
