// The judge is judged: a sound companion passes, and one that breaks a rule is told which.
#include "drivers/program/hil/controller_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <deque>
#include <functional>
#include <limits>
#include <numbers>

namespace epiline::hil {
namespace {

using testing::ElementsAre;

constexpr double kRadius_m = 5, kTurn_rad_s = 0.4, kClimb_m_s = 0.3;
constexpr HostStamp kBegin{5'000'000'000'000};

/// A vehicle on a spiral to the left, its nose along the path.
struct Spiral {
  double angle, height;
  explicit Spiral(HostStamp t)
      : angle(kTurn_rad_s * (t - kBegin).seconds()), height(kClimb_m_s * (t - kBegin).seconds()) {}
};

Eigen::Quaternionf about_z(double angle) {
  return Eigen::Quaternionf(Eigen::AngleAxisf(static_cast<float>(angle), Eigen::Vector3f::UnitZ()));
}

void set_diagonals(std::array<float, 21>& c, float first, float second) {
  c = {};
  c[0] = c[6] = c[11] = first;
  c[15] = c[18] = c[20] = second;
}

/// What it is to be told, written down by hand: forward, right, down.
mavlink::Odometry odometry_at(HostStamp t) {
  const Spiral s(t);
  mavlink::Odometry m;
  m.time_usec = static_cast<std::uint64_t>(t.ns / 1000);
  m.x = static_cast<float>(kRadius_m * std::cos(s.angle));
  m.y = static_cast<float>(-kRadius_m * std::sin(s.angle));
  m.z = static_cast<float>(-s.height);
  const Eigen::Quaternionf q = about_z(-(s.angle + std::numbers::pi / 2));
  m.q = {q.w(), q.x(), q.y(), q.z()};
  m.vx = static_cast<float>(kRadius_m * kTurn_rad_s);
  m.vz = static_cast<float>(-kClimb_m_s);
  m.yawspeed = static_cast<float>(-kTurn_rad_s);
  set_diagonals(m.pose_covariance, 1e-4F, 1e-4F);
  set_diagonals(m.velocity_covariance, 1e-4F, 1e-6F);
  m.quality = 80;
  return m;
}

/// The same in a world that is turned and shifted.
std::optional<TruthState> truth_at(HostStamp t) {
  const Spiral s(t);
  const Mat3 turn = Eigen::AngleAxisd(0.7, Vec3::UnitZ()).toRotationMatrix();
  TruthState truth;
  truth.p_WB = turn * Vec3(kRadius_m * std::cos(s.angle), kRadius_m * std::sin(s.angle), s.height) + Vec3(10, -20, 3);
  const double speed = kRadius_m * kTurn_rad_s;
  truth.v_WB = turn * Vec3(-speed * std::sin(s.angle), speed * std::cos(s.angle), kClimb_m_s);
  truth.R_WB = turn * Eigen::AngleAxisd(s.angle + std::numbers::pi / 2, Vec3::UnitZ()).toRotationMatrix();
  return truth;
}

/// A companion computer, whose habits a test may spoil. Times in seconds since the begin.
struct Companion {
  double duration_s = 8;
  double rate_hz = 40;
  double latency_s = 0.004;  ///< from a stamp to the arrival
  double answer_s = 0.001;   ///< until a TIMESYNC is answered; negative: never
  double heartbeat_s = 1;    ///< interval
  double clock_jump_s = 0;   ///< of the clock that answers show, half-way
  mavlink::Address address;
  mavlink::Heartbeat heartbeat{.system_status = 4};
  std::function<void(mavlink::Odometry&, double t)> spoil = [](mavlink::Odometry&, double) {};
  std::function<bool(double t)> sends = [](double) { return true; };
  std::vector<std::pair<double, std::string>> texts;
  bool skip_a_number = false;
  std::vector<std::pair<double, mavlink::SetGpsGlobalOrigin>> origins;
};

class Bench {
 public:
  Bench(const Companion& companion, ControllerSettings settings)
      : companion_(companion),
        model_(settings, truth_at),
        texts_(companion.texts.begin(), companion.texts.end()),
        origins_(companion.origins.begin(), companion.origins.end()) {}

  Verdict run() {
    const auto steps = static_cast<int>(companion_.duration_s * 1000);
    for (int ms = 0; ms < steps; ++ms) step(1e-3 * ms);
    return model_.finish(kBegin + Span::from_seconds(companion_.duration_s));
  }
  const ControllerModel& model() const { return model_; }

 private:
  template <class Message>
  void send(const Message& message, HostStamp now) {
    if (companion_.skip_a_number && sequence_ == 100) ++sequence_;
    model_.receive(mavlink::pack(message, companion_.address, sequence_++), now);
  }

  void step(double t) {
    const HostStamp now = kBegin + Span::from_seconds(t);
    if (t >= next_heartbeat_) {
      next_heartbeat_ += companion_.heartbeat_s;
      send(companion_.heartbeat, now);
    }
    while (!texts_.empty() && t >= texts_.front().first) {
      mavlink::StatusText m;
      std::memcpy(m.text.data(), texts_.front().second.data(), std::min(texts_.front().second.size(), m.text.size()));
      send(m, now);
      texts_.pop_front();
    }
    for (; !origins_.empty() && t >= origins_.front().first; origins_.pop_front()) send(origins_.front().second, now);
    if (t >= next_odometry_) {
      next_odometry_ += 1 / companion_.rate_hz;
      mavlink::Odometry m = odometry_at(now - Span::from_seconds(companion_.latency_s));
      companion_.spoil(m, t);
      if (companion_.sends(t)) send(m, now);
    }
    while (!answers_.empty() && t >= answers_.front().first) {
      send(answers_.front().second, now);
      answers_.pop_front();
    }
    while (const mavlink::Packet* packet = model_.next(now)) hear(*packet, now, t);
  }

  void hear(const mavlink::Packet& packet, HostStamp now, double t) {
    mavlink::Timesync m;
    if (!mavlink::unpack(packet, m) || m.tc1 != 0 || companion_.answer_s < 0) return;
    const double jump = t > 0.5 * companion_.duration_s ? companion_.clock_jump_s : 0;
    m.tc1 = (now + Span::from_seconds(0.5 * companion_.answer_s + jump)).ns;
    answers_.emplace_back(t + companion_.answer_s, m);
  }

  Companion companion_;
  ControllerModel model_;
  std::deque<std::pair<double, std::string>> texts_;
  std::deque<std::pair<double, mavlink::SetGpsGlobalOrigin>> origins_;
  std::deque<std::pair<double, mavlink::Timesync>> answers_;
  double next_heartbeat_ = 0.1, next_odometry_ = 0.2;
  std::uint8_t sequence_ = 0;
};

ControllerSettings settings() {
  ControllerSettings s;
  s.skew_ppm = 40;
  s.timesync_hz = 100;  // converges within 6 s
  return s;
}

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
  companion.texts = {{0.15, "tracking"}};
  companion.origins = {{1, kZurich}, {6, kZurich}};
  ControllerSettings ardupilot = settings();
  ardupilot.wants_origin = true;
  const Verdict verdict = Bench(companion, ardupilot).run();
  EXPECT_TRUE(verdict.accepted()) << text_of(verdict, kBegin);
  for (const RuleVerdict& v : verdict.rules)
    EXPECT_EQ(v.state, v.rule < Rule::kCanFrames ? RuleState::kKept : RuleState::kNotSeen)
        << info_of(v.rule).name << ": each rule had its occasion";
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
  EXPECT_THAT(verdict_of(companion).broken(), ElementsAre(Rule::kFusion));
}

TEST(ControllerModel, AnArduPilotWithoutSatellitesWantsAnOrigin) {
  ControllerSettings ardupilot = settings();
  ardupilot.wants_origin = true;
  EXPECT_THAT(Bench({}, ardupilot).run().broken(), ElementsAre(Rule::kOrigin));
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
  EXPECT_EQ(verdict.broken(), GetParam().broken) << text_of(verdict, kBegin);
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
    {"late_for_ArduPilot", [](Companion& c) { c.latency_s = 0.27; }, {Rule::kLatencyArdupilot}},
    {"late_for_both", [](Companion& c) { c.latency_s = 0.35; }, {Rule::kLatencyPx4, Rule::kLatencyArdupilot}},
    {"stamps_of_another_clock_than_its_answers",
     [](Companion& c) { c.spoil = [](mavlink::Odometry& m, double) { m.time_usec += 1'000'000; }; },
     {Rule::kLatencyPx4, Rule::kLatencyArdupilot}},
    {"answers_nobody", [](Companion& c) { c.answer_s = -1; }, {Rule::kTimesyncAnswers}},
    {"answers_within_the_limit", [](Companion& c) { c.answer_s = 0.008; }, {}},
    {"answers_late", [](Companion& c) { c.answer_s = 0.015; }, {Rule::kTimesyncAnswers}},
    {"its_clock_jumps", [](Companion& c) { c.duration_s = 12, c.clock_jump_s = 0.2; }, {Rule::kTimesyncConvergence}},
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
    {"an_empty_text",
     [](Companion& c) {
       c.texts = {{3, ""}};
     },
     {Rule::kStatusText}},
    {"a_text_of_bytes",
     [](Companion& c) {
       c.texts = {{3, "\x01\x02"}};
     },
     {Rule::kStatusText}},
    {"talks_all_the_time",
     [](Companion& c) {
       for (int i = 0; i < 20; ++i) c.texts.emplace_back(1 + 0.1 * i, "tracking");
     },
     {Rule::kStatusText}},
    {"an_origin_that_moves",
     [](Companion& c) {
       c.origins = {{1, kZurich}, {2, moved(&mavlink::SetGpsGlobalOrigin::longitude, 85455950)}};
     },
     {Rule::kOrigin}},
    {"an_origin_off_the_earth",
     [](Companion& c) {
       c.origins = {{1, moved(&mavlink::SetGpsGlobalOrigin::latitude, 900000001)}};
     },
     {Rule::kOrigin}},
};

INSTANTIATE_TEST_SUITE_P(Hil, Offences, testing::ValuesIn(kOffences),
                         [](const auto& offence) { return std::string(offence.param.name); });

// Lost: it says so, is silent, and comes back elsewhere with a new counter.
TEST(ControllerModel, AnAnnouncedPauseAndAResetAreKept) {
  Companion companion;
  companion.sends = [](double t) { return t < 3 || t > 5; };
  companion.texts = {{2.98, "odometry lost"}, {5, "odometry back"}};
  companion.spoil = [](mavlink::Odometry& m, double t) {
    if (t > 4) m.reset_counter = 1, m.x += 3;
  };
  const Verdict verdict = verdict_of(companion);
  EXPECT_TRUE(verdict.accepted()) << text_of(verdict, kBegin);
}

// A jump with a new counter restarts the controller's filter instead of being refused.
TEST(ControllerModel, AJumpThatIsToldIsKept) {
  Companion companion;
  companion.spoil = [](mavlink::Odometry& m, double t) {
    if (t >= 3) m.reset_counter = 255, m.x += 3;
    if (t >= 5) m.reset_counter = 0, m.y += 3;
  };
  const Verdict verdict = verdict_of(companion);
  EXPECT_TRUE(verdict.accepted()) << text_of(verdict, kBegin);
}

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

TEST(RuleNames, AreInTheOrderOfRules) {
  EXPECT_STREQ(info_of(Rule::kFusion).name, "fusion");
  EXPECT_STREQ(info_of(Rule::kLatencyPx4).name, "latency 300 ms");
  EXPECT_STREQ(info_of(Rule::kStatusText).name, "status text");
  EXPECT_STREQ(info_of(Rule::kOrigin).name, "origin");
  EXPECT_FALSE(info_of(Rule::kFramesArdupilot).px4);
  EXPECT_FALSE(info_of(Rule::kInnovation).ardupilot);
}

}  // namespace
}  // namespace epiline::hil
