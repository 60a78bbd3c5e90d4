// What the judge says of resets: pauses, jumps, turns of the frame. And which releases it judges for.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/drivers/program/hil/companion.h"

namespace epiline::hil {
namespace {

using testing::ElementsAre;

// Lost: it says so, is silent, and comes back elsewhere with a new counter.
TEST(ControllerModel, AnAnnouncedPauseAndAResetAreKept) {
  Companion companion;
  companion.sends = [](double t) { return t < 3 || t > 5; };
  companion.more = {text_at(2.98, "odometry lost"), text_at(5, "odometry back")};
  companion.spoil = [](mavlink::Odometry& m, double t) {
    if (t > 4) m.reset_counter = 1, m.x += 3;
  };
  const Verdict verdict = Bench(companion, settings()).run();
  EXPECT_TRUE(verdict.accepted_by(kUsualReleases)) << text_of(verdict, kBegin);
}

/// Lost from 3 s to 5 s; the frame comes back turned by that many degrees, in LOCAL_NED (1) or LOCAL_FRD (20).
Verdict turned_at_a_reset(double degrees, std::uint8_t frame, bool pauses, float sigma_rad = 0.01F) {
  Companion companion;
  if (pauses) companion.sends = [](double t) { return t < 3 || t > 5; };
  companion.more = {text_at(2.98, "odometry lost"), text_at(5, "odometry back")};
  companion.spoil = [=](mavlink::Odometry& m, double t) {
    m.frame_id = frame;
    m.pose_covariance[20] = sigma_rad * sigma_rad;
    if (t <= 4) return;
    const Eigen::Quaternionf turn = about_z(degrees * std::numbers::pi / 180);
    const Eigen::Quaternionf q = turn * Eigen::Quaternionf(m.q[0], m.q[1], m.q[2], m.q[3]);
    const Eigen::Vector3f p = turn * Eigen::Vector3f(m.x, m.y, m.z);
    m.q = {q.w(), q.x(), q.y(), q.z()};
    m.x = p.x(), m.y = p.y(), m.z = p.z();
    m.reset_counter = 1;
  };
  return Bench(companion, settings()).run();
}

// Without a pause PX4 resets its heading with the counter, and in LOCAL_FRD always. In LOCAL_NED after a pause it does
// not.
TEST(ControllerModel, TheTurnOfTheFrameAtAResetIsJudged) {
  constexpr std::uint8_t kNed = 1, kFrd = 20;
  const auto broken = [](const Verdict& v) { return v.broken(kUsualReleases); };
  EXPECT_THAT(broken(turned_at_a_reset(52, kFrd, true)), ElementsAre(Rule::kTurnArdupilot));
  EXPECT_THAT(broken(turned_at_a_reset(-52, kFrd, true)), ElementsAre(Rule::kTurnArdupilot));
  EXPECT_THAT(broken(turned_at_a_reset(30, kFrd, true)), ElementsAre());
  const Rule frames = Rule::kFramesArdupilot;
  EXPECT_THAT(broken(turned_at_a_reset(52, kNed, true)),
              ElementsAre(frames, Rule::kTurnPx4Before27342, Rule::kTurnPx4, Rule::kTurnArdupilot));
  const Verdict between = turned_at_a_reset(20, kNed, true);
  EXPECT_THAT(broken(between), ElementsAre(frames, Rule::kTurnPx4));
  EXPECT_TRUE(between.accepted_by(*releases_from("px4-1.14,px4-1.15,px4-1.16,px4-1.17")));
  for (const char* newer : {"px4-1.18", "px4-main"}) EXPECT_FALSE(between.accepted_by(*releases_from(newer)));
  EXPECT_THAT(broken(turned_at_a_reset(10, kNed, true)), ElementsAre(frames));
  EXPECT_THAT(broken(turned_at_a_reset(20, kNed, false)), ElementsAre(frames));
  EXPECT_THAT(broken(turned_at_a_reset(20, kNed, true, 0.2F)), ElementsAre(frames)) << "who doubts is believed";
}

// Vision that drifts away is refused for a second, again and again: PX4 starts anew each time, and never gives up.
TEST(ControllerModel, TheFilterNeverGivesUp) {
  Companion companion;
  companion.duration_s = 20;
  companion.spoil = [](mavlink::Odometry& m, double t) { m.x += static_cast<float>(3 * t); };
  EXPECT_THAT(Bench(companion, settings()).run().broken(kEveryPx4 & kUsualReleases),
              ElementsAre(Rule::kVelocity, Rule::kInnovation));
}

TEST(ControllerModel, SomeBuildsArmWithANorthOnly) {
  const auto broken_in = [](std::uint8_t frame) {
    Companion companion;
    companion.spoil = [=](mavlink::Odometry& m, double) { m.frame_id = frame; };
    return Bench(companion, settings()).run().broken(*releases_from("px4-spring-2026"));
  };
  EXPECT_THAT(broken_in(20), ElementsAre(Rule::kArming));
  EXPECT_THAT(broken_in(1), ElementsAre());
}

// A jump with a new counter restarts the controller's filter instead of being refused.
TEST(ControllerModel, AJumpThatIsToldIsKeptAndBeginsATrajectory) {
  Companion companion;
  companion.spoil = [](mavlink::Odometry& m, double t) {
    if (t >= 3) m.reset_counter = 255, m.x += 3;
    if (t >= 5) m.reset_counter = 0, m.y += 3;
  };
  Bench bench(companion, settings());
  const Verdict verdict = bench.run();
  EXPECT_TRUE(verdict.accepted_by(kUsualReleases)) << text_of(verdict, kBegin);
  const auto& parts = bench.model().received();
  ASSERT_EQ(parts.size(), 3U);
  EXPECT_NEAR((parts[1].poses.front().p_WB - parts[0].poses.back().p_WB).norm(), 3, 0.1);
  EXPECT_NEAR((parts[2].poses.front().p_WB - parts[1].poses.back().p_WB).norm(), 3, 0.1);
  EXPECT_NEAR((parts[2].poses.back().stamp - parts[2].poses.front().stamp).seconds(), 3, 0.1);
}

TEST(Releases, AreNamed) {
  EXPECT_EQ(releases_from("px4,ardupilot"), kUsualReleases);
  EXPECT_EQ(releases_from("all"), kEveryRelease);
  EXPECT_EQ(releases_from("px4-spring-2026"), kPx4Spring2026);
  EXPECT_EQ(releases_from("px4-1.18,px4-main"), kPx4Since27342);
  EXPECT_EQ(releases_from("ardupilot-4.5,ardupilot-4.6,ardupilot-4.7"), kEveryArdupilot);
  for (const char* wrong : {"", "px4,", ",px4", "px4 ", "PX4", "px4-1.13"}) EXPECT_FALSE(releases_from(wrong)) << wrong;
}

}  // namespace
}  // namespace epiline::hil
