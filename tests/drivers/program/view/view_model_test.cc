#include "drivers/program/view/view_model.h"

#include <gtest/gtest.h>

#include <limits>

namespace epiline {
namespace {

TEST(PathHistory, KeepsAFixedNumberOfPointsOverAnyLength) {
  PathHistory path;
  for (int i = 0; i < 200'000; ++i) path.add({0.05 * i, 0, 0}, HealthState::kTracking);
  const auto& points = path.points();
  EXPECT_LE(points.size(), PathHistory::kMostPoints);
  EXPECT_GT(points.size(), PathHistory::kMostPoints / 3);
  EXPECT_NEAR(path.length_m(), 0.05 * 199'999, 2 * path.step_m());
  EXPECT_FLOAT_EQ(points.front().p_W[0], 0);
  EXPECT_NEAR(points.back().p_W[0], 0.05 * 199'999, 2 * path.step_m());
  for (std::size_t i = 1; i < points.size(); ++i) {
    const float gap = points[i].p_W[0] - points[i - 1].p_W[0];
    ASSERT_GT(gap, 0);
    ASSERT_LT(gap, 2.6 * path.step_m());  // 0.05 m is the least, for a step of 0.02 m
  }
}

TEST(PathHistory, StandingStillAndNumbersThatAreNoneAddNothing) {
  PathHistory path;
  path.add({1, 2, 3}, HealthState::kTracking);
  for (int i = 0; i < 1000; ++i) path.add({1 + 1e-3 * (i % 3), 2, 3}, HealthState::kTracking);
  path.add({std::numeric_limits<double>::quiet_NaN(), 0, 0}, HealthState::kLost);
  EXPECT_EQ(path.points().size(), 1u);
  EXPECT_EQ(path.length_m(), 0);
}

TEST(RateMeter, IsTheSensorsOwnRateAndForgets) {
  RateMeter rate;
  EXPECT_EQ(rate.hz(), 0);
  HostStamp t{0};
  std::uint64_t n = 0;
  for (; n < 100; t = t + Span::from_milliseconds(50)) rate.note(n++, t);
  EXPECT_NEAR(rate.hz(), 20, 1e-9);
  for (; n < 3000; t = t + Span::from_milliseconds(5)) rate.note(n++, t);  // more than fit into two seconds
  EXPECT_NEAR(rate.hz(), 200, 1e-9);
  rate.note(n + 7, t - Span::from_seconds(9));  // out of order
  EXPECT_NEAR(rate.hz(), 200, 1e-9);
}

ViewedOutcome outcome(std::uint64_t serial, double x) {
  ViewedOutcome o;
  o.outcome.serial = serial;
  o.outcome.stamp = HostStamp{static_cast<std::int64_t>(serial) * 50'000'000};
  o.outcome.result.has_pose = true;
  o.outcome.odometry.p_WB_m = {x, 0, 0};
  o.outcome.odometry.health = {HealthState::kTracking, 0, 90};
  o.imu_samples = 10 * serial;
  o.newest_imu = o.outcome.stamp;
  return o;
}

Json told(const ViewModel& model, ViewCursor since = {}) { return Json::parse(model.state_json(since)); }

TEST(ViewModel, TellsWhatReceiversSay) {
  ViewModel model(ViewSubject{});
  EXPECT_TRUE(told(model)["receivers"].empty());
  model.set_notes_of_receivers({"PX4 1.17 uses position and velocity, not height and yaw"});
  EXPECT_EQ(told(model)["receivers"][0], "PX4 1.17 uses position and velocity, not height and yaw");
}

TEST(ViewModel, IsWholeBeforeTheFirstImage) {
  const Json s = told(ViewModel({"a \"flight\" </script>\xff", "epiline", {}, true}));
  EXPECT_TRUE(s["pose"].is_null());
  EXPECT_TRUE(s["t"].is_null());
  EXPECT_TRUE(s["R_BC"].is_null());
  EXPECT_TRUE(s["latency_ms"]["p50"].is_null());
  EXPECT_EQ(s["health"]["state"], "initialising");
  EXPECT_EQ(s["samples"]["rows"].size(), 0u);
  EXPECT_FALSE(s["finished"]);
}

TEST(ViewModel, TellsAPageWhatItDoesNotHaveYet) {
  ViewModel model{ViewSubject{}};
  for (std::uint64_t i = 0; i < 10; ++i) {
    model.take(outcome(i, static_cast<double>(i)));
    model.take(Publication{i, 2'000'000});
  }
  const Json all = told(model);
  EXPECT_EQ(all["path"]["points"].size(), 10u);
  EXPECT_EQ(all["samples"]["rows"].size(), 10u);
  EXPECT_EQ(all["events"]["rows"].size(), 1u);
  EXPECT_EQ(all["events"]["rows"][0]["text"], "tracking");
  EXPECT_NEAR(all["rates_hz"]["camera"].get<double>(), 20, 1e-6);
  EXPECT_NEAR(all["rates_hz"]["imu"].get<double>(), 200, 1e-6);
  EXPECT_EQ(all["samples"]["rows"][3][1], 2.0);
  const ViewCursor since{all["path"]["generation"], 10, all["samples"]["next"], all["events"]["next"]};
  const Json nothing = told(model, since);
  EXPECT_EQ(nothing["path"]["points"].size() + nothing["samples"]["rows"].size() + nothing["events"]["rows"].size(),
            0u);
  model.take(outcome(10, 10));
  const Json waiting = told(model, since);
  EXPECT_EQ(waiting["path"]["points"].size(), 1u);
  EXPECT_EQ(waiting["samples"]["rows"].size(), 0u);  // its latency is not known yet
  model.take(Publication{10, 3'000'000});
  const Json next = told(model, since);
  ASSERT_EQ(next["samples"]["rows"].size(), 1u);
  EXPECT_EQ(next["samples"]["rows"][0][1], 3.0);
  // cursors of another program, or made up, are no harm
  const std::uint64_t far = std::numeric_limits<std::uint64_t>::max();
  EXPECT_EQ(told(model, {far, far, far, far})["path"]["points"].size(), 11u);
}

TEST(ViewModel, AnEstimateThatWasNeverPublishedHoldsNothingUp) {
  ViewModel model{ViewSubject{}};
  for (std::uint64_t i = 0; i < 5; ++i) model.take(outcome(i, 0));
  model.take(Publication{3, 1'000'000});
  const Json s = told(model);
  ASSERT_EQ(s["samples"]["rows"].size(), 4u);
  EXPECT_TRUE(s["samples"]["rows"][2][1].is_null());
  model.finish();
  EXPECT_EQ(told(model)["samples"]["rows"].size(), 5u);
}

TEST(ViewModel, HealthResetsAndEventsBecomeNotes) {
  ViewModel model{ViewSubject{}};
  model.take(outcome(0, 0));
  ViewedOutcome bad = outcome(1, 0);
  bad.outcome.odometry.health = {HealthState::kDegraded, 4 | 256, 20};
  model.take(bad);
  bad.outcome.serial = 2;
  bad.outcome.odometry.health.reasons |= 64;
  model.take(bad);
  bad.outcome.serial = 3;
  bad.outcome.odometry.reset_counter = 1;
  bad.outcome.odometry.health = {HealthState::kInitialising, 1, 0};
  model.take(bad);
  model.take(Event{HostStamp{0}, EventId::kImuGap, {30'000'000, 0, 0}});
  model.take(Event{HostStamp{0}, EventId::kHealthChanged, {1, 2, 4}});  // known from the outcomes
  const Json rows = told(model)["events"]["rows"];
  ASSERT_EQ(rows.size(), 6u) << rows;
  EXPECT_EQ(rows[1]["text"], "degraded");
  EXPECT_EQ(rows[1]["details"], Json::array({"few_tracks", "imu_gap"}));
  EXPECT_EQ(rows[2]["kind"], "reason");
  EXPECT_EQ(rows[2]["details"], Json::array({"scale_unknown"}));
  EXPECT_EQ(rows[3]["kind"], "reset");
  EXPECT_EQ(rows[4]["text"], "initialising");
  EXPECT_EQ(rows[5]["text"], "imu_gap length_ns=30000000");
}

TEST(ViewModel, NumbersThatAreNoneAreNull) {
  ViewModel model{ViewSubject{}};
  ViewedOutcome o = outcome(0, std::numeric_limits<double>::quiet_NaN());
  o.outcome.odometry.covariance.fill(std::numeric_limits<double>::infinity());
  model.take(o);
  const Json s = told(model);
  EXPECT_TRUE(s["pose"]["p"][0].is_null());
  EXPECT_TRUE(s["pose"]["covariance_p"][0].is_null());
  EXPECT_TRUE(s["pose"]["sigma_v"][0].is_null());
}

TEST(ViewModel, OfALongFlightTheNewestRemains) {
  ViewModel model{ViewSubject{}};
  for (std::uint64_t i = 0; i < 10'000; ++i) {
    model.take(outcome(i, 0.1 * static_cast<double>(i)));
    model.take(Publication{i, 1'000'000});
    model.take(Event{HostStamp{0}, EventId::kImuGap, {}});
  }
  const Json s = told(model);
  EXPECT_EQ(s["samples"]["rows"].size(), 2048u);
  EXPECT_NEAR(s["samples"]["rows"].back()[0].get<double>(), 0.05 * 9999, 1e-6);
  EXPECT_LE(s["path"]["points"].size(), PathHistory::kMostPoints);
  EXPECT_EQ(s["events"]["rows"].size(), 128u);
  EXPECT_LT(s.dump().size(), 500'000u);
}

}  // namespace
}  // namespace epiline
