// The controller's reading of CAN frames, against frames as the output writes them.
#include "drivers/program/hil/can_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "drivers/links/mavlink/odometry.h"
#include "drivers/program/hil/controller_model.h"

namespace epiline::hil {
namespace {

using testing::ElementsAre;

constexpr int kBaseId = 0x300;
constexpr HostStamp kBusBegin{5'000'000'000'000};

/// A flight straight ahead and up, nose 0.5 rad to the left, rolled by 0.2 rad; in the axes of our estimator.
Odometry true_odometry_at(HostStamp t) {
  const double s = (t - kBusBegin).seconds();
  Odometry o;
  o.stamp = t;
  o.p_WB_m = {2 * s, 1 * s, 0.5 * s};
  o.v_WB_m_s = {2, 1, 0.5};
  const Eigen::Quaterniond q(Eigen::AngleAxisd(0.5, Vec3::UnitZ()) * Eigen::AngleAxisd(0.2, Vec3::UnitX()));
  o.q_WB = {q.w(), q.x(), q.y(), q.z()};
  for (std::size_t i = 0; i < 16; ++i) o.covariance[17 * i] = 1e-4;
  o.health = {HealthState::kTracking, 0, 70};
  return o;
}

struct Bus {
  explicit Bus(bool fd) : writer(kBaseId, fd) {}
  std::vector<can::Frame> at(HostStamp t, bool deviations) {
    const Odometry o = true_odometry_at(t);
    const can::Values values = can::values_of(o, Mat3::Identity(), 3, t);
    std::vector<can::Frame> frames;
    for (const can::Frame& f : writer.odometry(values, deviations)) frames.push_back(f);
    frames.push_back(writer.status(values));
    return frames;
  }
  can::FrameWriter writer;
};

class CanReaders : public testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(Hil, CanReaders, testing::Bool(),
                         [](const auto& fd) { return std::string(fd.param ? "fd" : "classic"); });

TEST_P(CanReaders, SaysWhatTheMessageOfMavlinkSays) {
  Bus bus(GetParam());
  CanReader reader(kBaseId);
  RuleBook book;
  std::optional<mavlink::Odometry> got;
  for (int i = 0; i < 3; ++i)
    for (const can::Frame& f : bus.at(kBusBegin + Span::from_milliseconds(1'000 + 20 * i), i == 0))
      if (const auto m = reader.take(f, kBusBegin, book)) got = m;
  ASSERT_TRUE(got);
  const mavlink::Odometry expected =
      mavlink::odometry_message(true_odometry_at(kBusBegin + Span::from_milliseconds(1'040)), Mat3::Identity());
  EXPECT_EQ(got->time_usec, expected.time_usec);
  const auto position_of = [](const mavlink::Odometry& m) { return Eigen::Vector3f(m.x, m.y, m.z); };
  const auto velocity_of = [](const mavlink::Odometry& m) { return Eigen::Vector3f(m.vx, m.vy, m.vz); };
  const auto attitude_of = [](const mavlink::Odometry& m) {
    return Eigen::Quaternionf(m.q[0], m.q[1], m.q[2], m.q[3]);
  };
  EXPECT_LT((position_of(*got) - position_of(expected)).norm(), 1e-3);
  EXPECT_LT((velocity_of(*got) - velocity_of(expected)).norm(), 2e-3);
  EXPECT_LT(attitude_of(*got).angularDistance(attitude_of(expected)), 5e-4);
  EXPECT_NEAR(got->pose_covariance[0], 1e-4, 1e-5);
  EXPECT_EQ(got->quality, 70);
  EXPECT_EQ(got->reset_counter, 3);
  EXPECT_TRUE(book.verdict().accepted_by(kUsualReleases)) << text_of(book.verdict(), kBusBegin);
}

/// 4 s of a bus, each frame as `spoil` leaves it; false: it is lost.
Verdict verdict_of(bool fd, const std::function<bool(can::Frame&, int epoch)>& spoil) {
  ControllerSettings settings;
  settings.on_can = true;
  settings.can_base_id = kBaseId;
  ControllerModel model(settings);
  Bus bus(fd);
  for (int i = 0; i < 160; ++i) {
    const HostStamp t = kBusBegin + Span::from_milliseconds(25 * i);
    for (can::Frame f : bus.at(t, i % 8 == 0))
      if (spoil(f, i)) model.receive(f, t + Span::from_milliseconds(2));
  }
  return model.finish(kBusBegin + Span::from_milliseconds(4'000));
}

TEST_P(CanReaders, ASoundBusIsAccepted) {
  const Verdict verdict = verdict_of(GetParam(), [](can::Frame&, int) { return true; });
  EXPECT_TRUE(verdict.accepted_by(kUsualReleases)) << text_of(verdict, kBusBegin);
  for (const Rule rule : {Rule::kFusion, Rule::kCanFrames, Rule::kCanStatus, Rule::kVelocity, Rule::kLatencyPx4})
    EXPECT_EQ(verdict.of(rule).state(), RuleState::kKept) << info_of(rule).name;
  EXPECT_EQ(verdict.of(Rule::kHeartbeat).state(), RuleState::kNotSeen);
}

TEST_P(CanReaders, AFrameThatIsWrongOrMissingIsNamed) {
  const auto is_velocity = [](const can::Frame& f) { return f.id == kBaseId + 5 || f.id == kBaseId + 10; };
  EXPECT_THAT(verdict_of(GetParam(),
                         [&](can::Frame& f, int i) {
                           if (i == 50 && is_velocity(f)) f.data[3] ^= 4;
                           return true;
                         })
                  .broken(),
              ElementsAre(Rule::kCanFrames));
  EXPECT_THAT(verdict_of(GetParam(), [&](can::Frame& f, int i) { return i != 50 || !is_velocity(f); }).broken(),
              ElementsAre(Rule::kCanFrames));
}

TEST_P(CanReaders, AStatusThatStopsIsNamed) {
  const Verdict verdict = verdict_of(GetParam(), [](can::Frame& f, int i) { return i < 80 || f.id != kBaseId; });
  EXPECT_THAT(verdict.broken(), ElementsAre(Rule::kCanStatus));
}

}  // namespace
}  // namespace epiline::hil
