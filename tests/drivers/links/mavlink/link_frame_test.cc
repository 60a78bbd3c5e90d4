// In which frame the link sends poses, and to which flight controller not.
#include <gtest/gtest.h>

#include "drivers/links/mavlink/link.h"
#include "tests/drivers/links/mavlink/fake_line.h"

namespace epiline::mavlink {
namespace {

/// Whether the link sends what `config` asks for to that autopilot; it says why not.
std::string refusal_of(const MavlinkConfig& config, std::uint8_t autopilot) {
  LinkOnALine rig(config);
  rig.begin();
  rig.line.peer.send(Heartbeat{.type = 2, .autopilot = autopilot});
  EXPECT_TRUE(rig.wait_for([&] { return rig.link.state().peer.is_known; }));
  EXPECT_TRUE(rig.fly([&] { return rig.sent<Heartbeat>().size() >= 3; }));
  const bool sends = !rig.sent<Odometry>().empty() || !rig.sent<VisionPositionEstimate>().empty();
  EXPECT_EQ(sends, rig.link.state().refusal == Refusal::kNone);
  EXPECT_EQ(rig.link.counts().dropped, 0U);
  const auto texts = rig.sent<StatusText>();
  EXPECT_EQ(std::string(texts.back().text.data()), sends ? "VIO ok" : "VIO not sent: see mavlink.frame of epiline");
  return sentence_of(rig.link.state().refusal);
}

// PX4 takes VISION_POSITION_ESTIMATE for a pose to true north; ArduPilot takes ODOMETRY in LOCAL_FRD alone.
TEST(MavlinkLink, RefusesWhatTheControllerWouldMisunderstand) {
  const MavlinkConfig odometry, odometry_north = north(0), position = config_with(&MavlinkConfig::message, 1);
  MavlinkConfig position_north = north(0);
  position_north.message = 1;
  EXPECT_EQ(refusal_of(odometry, kPx4), "");
  EXPECT_EQ(refusal_of(odometry, kArduPilot), "");
  EXPECT_EQ(refusal_of(odometry_north, kPx4), "");
  EXPECT_EQ(refusal_of(odometry_north, kArduPilot),
            "ArduPilot ignores ODOMETRY in mavlink.frame = \"local-ned\": odometry is not sent");
  EXPECT_EQ(refusal_of(position, kPx4),
            "PX4 takes mavlink.message = \"vision-position\" for a pose to true north: odometry is not sent");
  EXPECT_EQ(refusal_of(position, kArduPilot), "");
  EXPECT_EQ(refusal_of(position_north, kPx4), "");
  EXPECT_EQ(refusal_of(position_north, kArduPilot), "");
}

TEST(MavlinkLink, SendsToTheNorth) {
  LinkOnALine rig(north(90));
  rig.begin();
  ASSERT_TRUE(rig.fly([&] { return rig.sent<Odometry>().size() >= 5; }));
  const Odometry last = rig.sent<Odometry>().back();
  EXPECT_EQ(last.frame_id, 1);
  EXPECT_NEAR(last.x, 0, 1e-3);  // ahead is east
  EXPECT_NEAR(last.y, 1e-6 * static_cast<double>(last.time_usec % 1'000'000'000), 1e-2);
}

}  // namespace
}  // namespace epiline::mavlink
