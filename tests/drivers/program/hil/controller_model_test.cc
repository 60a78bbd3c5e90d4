// The judge is judged: a sound companion passes, and one that breaks a rule is told which.
#include "drivers/program/hil/controller_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <numbers>

#include "tests/drivers/program/hil/companion.h"

namespace epiline::hil {
namespace {

using testing::ElementsAre;

Verdict verdict_of(const Companion& companion) { return Bench(companion, settings()).run(); }

constexpr mavlink::SetGpsGlobalOrigin kZurich{473977420, 85455940, 488100, 1, 0};
mavlink::SetGpsGlobalOrigin moved(std::int32_t mavlink::SetGpsGlobalOrigin::*member, std::int32_t value) {
  mavlink::SetGpsGlobalOrigin m = kZurich;
  m.*member = value;
  return m;
}

void at_3_s(double t, const std::function<void()>& change) {
  if (t >= 3 && t < 3.02) change();
}

TEST(ControllerModel, ASoundCompanionIsAccepted) {
  Companion companion;
  companion.more = {text_at(0.15, "tracking"), at(1, kZurich), at(6, kZurich)};
  ControllerSettings ardupilot = settings();
  ardupilot.wants_origin = true;
  const Verdict verdict = Bench(companion, ardupilot).run();
  EXPECT_TRUE(verdict.accepted_by(kUsualReleases)) << text_of(verdict, kBegin);
  const auto state_of = [](Rule rule) {
    if (rule == Rule::kArming) return RuleState::kBroken;
    const bool is_turn = rule >= Rule::kTurnPx4Before27342 && rule <= Rule::kTurnArdupilot;
    return rule >= Rule::kCanFrames || is_turn ? RuleState::kNotSeen : RuleState::kKept;
  };
  for (const RuleVerdict& v : verdict.rules)
    EXPECT_EQ(v.state(), state_of(v.rule)) << info_of(v.rule).name << ": each rule had its occasion";
}

TEST(ControllerModel, LatencyIsMeasuredInItsOwnClock) {
  Companion companion;
  companion.latency_s = 0.017;
  Bench bench(companion, settings());
  bench.run();
  // the answers' stamps lie in the middle: no asymmetry
  EXPECT_NEAR(static_cast<double>(bench.model().latency().quantile_ns(0.5)), 17e6, 1.1e6);
  EXPECT_NEAR(static_cast<double>(bench.model().latency().most_ns()), 17e6, 1e6);
}

TEST(ControllerModel, WhoSendsNothingIsRefused) {
  Companion companion;
  companion.sends = [](double) { return false; };
  EXPECT_THAT(verdict_of(companion).broken(kUsualReleases), ElementsAre(Rule::kFusion));
}

TEST(ControllerModel, AnArduPilotWithoutSatellitesWantsAnOrigin) {
  ControllerSettings ardupilot = settings();
  ardupilot.wants_origin = true;
  EXPECT_THAT(Bench({}, ardupilot).run().broken(kUsualReleases), ElementsAre(Rule::kOrigin));
}

struct Offence {
  const char* name;
  std::function<void(Companion&)> commit;
  std::vector<Rule> broken;
};
void PrintTo(const Offence& offence, std::ostream* out) { *out << offence.name; }

class Offences : public testing::TestWithParam<Offence> {};

TEST_P(Offences, AreNamed) {
  Companion companion;
  GetParam().commit(companion);
  const Verdict verdict = verdict_of(companion);
  EXPECT_EQ(verdict.broken(kUsualReleases), GetParam().broken) << text_of(verdict, kBegin);
  for (const Rule rule : GetParam().broken) EXPECT_FALSE(verdict.of(rule).first.empty());
}

std::function<void(Companion&)> once(const std::function<void(mavlink::Odometry&)>& change) {
  return [=](Companion& c) { c.spoil = [=](mavlink::Odometry& m, double t) { at_3_s(t, [&] { change(m); }); }; };
}
std::function<void(Companion&)> silent(double from, double to) {
  return [=](Companion& c) { c.sends = [=](double t) { return t < from || t >= to; }; };
}

const auto kNaN = std::numeric_limits<float>::quiet_NaN();

const std::vector<Offence> kOffences = {
    {"a_body_frame_of_the_past",
     once([](auto& m) { m.child_frame_id = 8; }),
     {Rule::kFramesPx4, Rule::kFramesArdupilot}},
    {"north_east_down_is_for_PX4_alone", once([](auto& m) { m.frame_id = 1; }), {Rule::kFramesArdupilot}},
    {"an_estimator_of_GPS", once([](auto& m) { m.estimator_type = 4; }), {Rule::kEstimatorType}},
    {"a_naive_estimator", once([](auto& m) { m.estimator_type = 1; }), {Rule::kEstimatorType}},
    {"no_number", once([](auto& m) { m.y = kNaN; }), {Rule::kFinite}},
    {"a_quaternion_of_zeros", once([](auto& m) { m.q = {}; }), {Rule::kFinite}},
    {"an_unknown_covariance", once([](auto& m) { m.pose_covariance[0] = kNaN; }), {Rule::kCovariance}},
    {"a_negative_variance", once([](auto& m) { m.velocity_covariance[6] = -1e-4F; }), {Rule::kCovariance}},
    {"an_infinite_variance", once([](auto& m) { m.pose_covariance[11] = 1e38F; }), {Rule::kCovariance}},
    {"correlated_beyond_one", once([](auto& m) { m.pose_covariance[1] = 2e-4F; }), {Rule::kCovariance}},
    {"quality_of_a_percentage_beyond_100", once([](auto& m) { m.quality = 101; }), {Rule::kQuality}},
    {"an_unknown_quality", once([](auto& m) { m.quality = 0; }), {Rule::kQuality}},
    {"sends_although_lost", once([](auto& m) { m.quality = -1; }), {Rule::kSilence}},
    {"the_same_pose_again",
     [](Companion& c) {
       c.spoil = [last = mavlink::Odometry{}](mavlink::Odometry& m, double t) mutable {
         if (t >= 3 && t < 3.02) m = last;
         last = m;
       };
     },
     {Rule::kStamps}},
    {"a_stamp_of_the_past", once([](auto& m) { m.time_usec -= 60'000; }), {Rule::kStamps}},
    {"a_stamp_that_is_no_time", once([](auto& m) { m.time_usec = ~std::uint64_t{0}; }), {Rule::kStamps}},
    {"too_slow", [](Companion& c) { c.rate_hz = 20; }, {Rule::kRate}},
    {"too_fast", [](Companion& c) { c.rate_hz = 80; }, {Rule::kRate}},
    {"far_too_fast", [](Companion& c) { c.rate_hz = 125; }, {Rule::kRate, Rule::kFlood}},
    {"slower_than_ArduPilot_needs",
     [](Companion& c) { c.rate_hz = 3.4; },
     {Rule::kFusion, Rule::kRateArdupilot, Rule::kGapStart}},
    {"a_pause_of_250_ms", silent(3, 3.22), {Rule::kGapStart}},
    {"a_pause_of_350_ms", silent(3, 3.32), {Rule::kGapStart, Rule::kGapArdupilot}},
    {"a_pause_of_half_a_second", silent(3, 3.47), {Rule::kGapStart, Rule::kGapStop, Rule::kGapArdupilot}},
    {"an_early_end", silent(7, 9), {Rule::kGapStart, Rule::kGapStop, Rule::kGapArdupilot}},
    {"late_for_PX4", [](Companion& c) { c.latency_s = 0.22; }, {Rule::kLatencyPx4}},
    {"late_for_both", [](Companion& c) { c.latency_s = 0.29; }, {Rule::kLatencyPx4, Rule::kLatencyArdupilot}},
    {"stamps_of_another_clock_than_its_answers",
     [](Companion& c) { c.spoil = [](mavlink::Odometry& m, double) { m.time_usec += 1'000'000; }; },
     {Rule::kLatencyPx4, Rule::kLatencyArdupilot}},
    {"answers_nobody", [](Companion& c) { c.answer_s = -1; }, {Rule::kTimesyncAnswers}},
    {"answers_within_the_limit", [](Companion& c) { c.answer_s = 0.008; }, {}},
    {"answers_late", [](Companion& c) { c.answer_s = 0.015; }, {Rule::kTimesyncAnswers}},
    {"its_clock_jumps", [](Companion& c) { c.duration_s = 12, c.clock_jump_s = 0.15; }, {Rule::kTimesyncConvergence}},
    {"no_heartbeat", [](Companion& c) { c.heartbeat_s = 100; }, {Rule::kHeartbeat}},
    {"a_slow_heart", [](Companion& c) { c.heartbeat_s = 1.5; }, {Rule::kHeartbeat}},
    {"a_fast_heart", [](Companion& c) { c.heartbeat_s = 0.1; }, {Rule::kHeartbeat}},
    {"pretends_to_be_an_autopilot", [](Companion& c) { c.heartbeat.autopilot = 12; }, {Rule::kHeartbeat}},
    {"pretends_to_be_a_vehicle", [](Companion& c) { c.heartbeat.type = 2; }, {Rule::kHeartbeat}},
    {"of_another_vehicle", [](Companion& c) { c.address.system = 2; }, {Rule::kAddress}},
    {"a_lost_message", [](Companion& c) { c.skip_a_number = true; }, {Rule::kSequence}},
    {"jumps_and_says_nothing",
     [](Companion& c) { c.spoil = [](mavlink::Odometry& m, double t) { m.x += t >= 3 ? 2 : 0; }; },
     {Rule::kResetCounter, Rule::kInnovation}},
    {"turns_and_says_nothing",
     [](Companion& c) {
       c.spoil = [](mavlink::Odometry& m, double t) {
         if (t < 3) return;
         const Eigen::Quaternionf q = about_z(0.5) * Eigen::Quaternionf(m.q[0], m.q[1], m.q[2], m.q[3]);
         m.q = {q.w(), q.x(), q.y(), q.z()};
         m.vx = 0;  // it stands still for its own velocity
         m.vz = 0;
       };
     },
     {Rule::kResetCounter, Rule::kVelocity, Rule::kInnovation}},
    {"a_reset_for_nothing",
     [](Companion& c) { c.spoil = [](mavlink::Odometry& m, double t) { m.reset_counter = t >= 3 ? 1 : 0; }; },
     {Rule::kResetCounter}},
    {"velocity_of_the_world_as_that_of_the_body",
     [](Companion& c) {
       c.spoil = [](mavlink::Odometry& m, double t) {
         const double heading = -(kTurn_rad_s * t + std::numbers::pi / 2);
         m.vy = static_cast<float>(m.vx * std::sin(heading));
         m.vx = static_cast<float>(m.vx * std::cos(heading));
       };
     },
     {Rule::kVelocity, Rule::kInnovation}},
    {"a_scale_of_its_own",  // consistent with itself, not with the accelerometer
     [](Companion& c) {
       c.spoil = [](mavlink::Odometry& m, double) {
         for (float* const x : {&m.x, &m.y, &m.z, &m.vx, &m.vz}) *x *= 3;
         set_diagonals(m.pose_covariance, 1e-6F, 1e-6F);
       };
     },
     {Rule::kInnovation}},
    {"an_empty_text", [](Companion& c) { c.more = {text_at(3, "")}; }, {Rule::kStatusText}},
    {"a_text_of_bytes", [](Companion& c) { c.more = {text_at(3, "\x01\x02")}; }, {Rule::kStatusText}},
    {"talks_all_the_time",
     [](Companion& c) {
       for (int i = 0; i < 20; ++i) c.more.push_back(text_at(1 + 0.1 * i, "tracking"));
     },
     {Rule::kStatusText}},
    {"an_origin_that_moves",
     [](Companion& c) {
       c.more = {at(1, kZurich), at(2, moved(&mavlink::SetGpsGlobalOrigin::longitude, 85455950))};
     },
     {Rule::kOrigin}},
    {"an_origin_off_the_earth",
     [](Companion& c) { c.more = {at(1, moved(&mavlink::SetGpsGlobalOrigin::latitude, 900000001))}; },
     {Rule::kOrigin}},
};

INSTANTIATE_TEST_SUITE_P(Hil, Offences, testing::ValuesIn(kOffences),
                         [](const auto& offence) { return std::string(offence.param.name); });

TEST(ControllerModel, VisionPositionEstimatesAreJudgedToo) {
  ControllerModel model(settings());
  for (int i = 0; i < 200; ++i) {
    const HostStamp t = kBegin + Span::from_milliseconds(25 * i);
    const mavlink::Odometry o = odometry_at(t);
    mavlink::VisionPositionEstimate m;
    m.usec = o.time_usec;
    m.x = o.x, m.y = o.y, m.z = o.z;
    m.yaw = static_cast<float>(-(Spiral(t).angle + std::numbers::pi / 2));
    m.covariance = o.pose_covariance;
    if (i == 100) m.covariance[0] = kNaN;
    if (i >= 150) m.x += 1;
    model.receive(mavlink::pack(m, {}, static_cast<std::uint8_t>(i)), t);
  }
  EXPECT_THAT(model.finish(kBegin + Span::from_milliseconds(5'000)).broken(),
              ElementsAre(Rule::kCovariance, Rule::kHeartbeat, Rule::kResetCounter));
}

TEST(ControllerModel, AnswersQuestionsInItsOwnClock) {
  ControllerSettings s = settings();
  s.boot = Span::from_milliseconds(-1'000);
  s.skew_ppm = 100;
  ControllerModel model(s);
  while (model.next(kBegin) != nullptr) {
  }
  model.receive(mavlink::pack(mavlink::Timesync{0, 123, 0, 0}, {}, 0), kBegin);
  const mavlink::Packet* const packet = model.next(kBegin);
  ASSERT_NE(packet, nullptr);
  mavlink::Timesync answer;
  ASSERT_TRUE(mavlink::unpack(*packet, answer));
  EXPECT_EQ(answer.ts1, 123);
  EXPECT_NEAR(static_cast<double>(answer.tc1 - kBegin.ns), 1e9 + 1e-4 * static_cast<double>(kBegin.ns), 2);
  EXPECT_EQ(packet->from.component, 1);
}

// Whoever floods it costs it nothing but the time to look.
TEST(ControllerModel, AFloodOfQuestionsIsNotAnsweredForEver) {
  ControllerModel model(settings());
  while (model.next(kBegin) != nullptr) {
  }
  for (int i = 0; i < 100'000; ++i)
    model.receive(mavlink::pack(mavlink::Timesync{0, i, 0, 0}, {}, static_cast<std::uint8_t>(i)), kBegin);
  int answers = 0;
  while (model.next(kBegin) != nullptr) ++answers;
  EXPECT_LE(answers, 64);
}

}  // namespace
}  // namespace epiline::hil
