// What the link asks a flight controller, and what it makes of the answers; and who is taken for one among others.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>
#include <random>

#include "drivers/links/mavlink/link.h"
#include "tests/drivers/links/mavlink/asked_controller.h"
#include "tests/drivers/links/mavlink/fake_line.h"

namespace epiline::mavlink {
namespace {

constexpr std::int64_t kSecond_ms = 1000;

/// A link, and a controller at the other end that lives through the made-up time.
struct Rig : LinkOnALine {
  explicit Rig(std::uint8_t autopilot = AskedController::kIsPx4, std::array<unsigned, 3> version = {1, 18, 0},
               const MavlinkConfig& changed = {}, const std::optional<ImuDeviceConfig>& imu = std::nullopt)
      : LinkOnALine(changed, imu), controller(line.peer, autopilot, version) {
    line.peer.on_packet = [this](const Packet& p) { controller.receive(p, line.now_ns()); };
    begin();
  }
  /// Heartbeats once a second, readings as asked for.
  void live(
      std::int64_t ms, const std::function<bool()>& done = [] { return false; }) {
    const std::int64_t until_ns = line.now_ns() + ms * kMs;
    while (line.now_ns() < until_ns && !done()) {
      if (line.now_ns() >= next_heartbeat_ns)
        controller.heartbeat(), next_heartbeat_ns = line.now_ns() + kSecond_ms * kMs;
      if (flies) estimates.step(link, line.now_ns());
      controller.reading(line.now_ns());
      advance(5 * kMs);
      line.peer.read();
    }
  }
  std::size_t odometry() const { return sent<Odometry>().size(); }
  ControllerAnswers answers() const { return link.state().answers; }

  AskedController controller;
  bool flies = false;
  std::int64_t next_heartbeat_ns = 0;
};

TEST(ControllerSurvey, ReadsReleaseAndParametersOfPx4) {
  Rig rig;
  rig.controller.parameters = {{"EKF2_EV_CTRL", 15}, {"EKF2_SENS_EN", 8183}, {"EKF2_EVA_NOISE", 0.1}};
  rig.live(4 * kSecond_ms);
  const ControllerAnswers a = rig.answers();
  EXPECT_TRUE(a.is_complete);
  EXPECT_EQ(a.version, 118);
  EXPECT_STREQ(a.release()->option, "px4-1.18");
  EXPECT_EQ(a.parameter("EKF2_EV_CTRL"), 15.0);
  EXPECT_EQ(a.parameter("EKF2_SENS_EN"), 8183.0) << "its integers are bits";
  EXPECT_FLOAT_EQ(static_cast<float>(*a.parameter("EKF2_EVA_NOISE")), 0.1F);
  EXPECT_EQ(a.parameter("EKF2_MAG_TYPE"), std::nullopt) << "it has none";
}

TEST(ControllerSurvey, ReadsReleaseAndParametersOfArduPilot) {
  Rig rig(AskedController::kIsArduPilot, {4, 6, 3});
  rig.controller.parameters = {{"VISO_TYPE", 1}, {"VISO_SCALE", 1.5}, {"VISO_QUAL_MIN", -1}, {"EK3_SRC1_POSXY", 6}};
  rig.live(4 * kSecond_ms);
  const ControllerAnswers a = rig.answers();
  EXPECT_TRUE(a.is_complete);
  EXPECT_EQ(a.version, 406);
  EXPECT_EQ(a.parameter("VISO_TYPE"), 1.0);
  EXPECT_EQ(a.parameter("VISO_SCALE"), 1.5);
  EXPECT_EQ(a.parameter("VISO_QUAL_MIN"), -1.0);
  EXPECT_EQ(a.parameter("EKF2_EV_CTRL"), std::nullopt) << "nobody's";
}

// A controller that answers nothing, and one that says it all: the questions end, and none is a command that sets.
TEST(ControllerSurvey, AsksSoManyTimesAndWritesNothing) {
  for (const bool answers : {false, true}) {
    Rig rig;
    for (const std::string_view name : kPx4Parameters)
      if (answers) rig.controller.parameters[std::string(name)] = 1;
    rig.controller.base_mode = 128;  // armed
    rig.line.peer.on_packet = [&](const Packet& p) {
      if (answers) rig.controller.receive(p, rig.line.now_ns());
    };
    rig.live(5 * kSecond_ms);
    const std::uint64_t first = rig.link.counts().questions;
    EXPECT_LE(first, 3 * (2 + kPx4Parameters.size()) + 2) << answers;
    EXPECT_TRUE(rig.answers().is_complete);
    rig.live(120 * kSecond_ms);
    EXPECT_LE(rig.link.counts().questions - first, 8U) << "for the filter's status alone, ever less often";
    EXPECT_TRUE(rig.answers().is_complete);
    for (const Packet& p : rig.line.peer.packets) EXPECT_NE(p.id, 23U) << "PARAM_SET";
  }
}

TEST(ControllerSurvey, TakesNoAbsurdValues) {
  Rig rig(AskedController::kIsArduPilot, {4, 7, 0});
  rig.controller.parameters = {{"VISO_SCALE", 1e30}, {"VISO_TYPE", std::nan("")}, {"VISO_ORIENT", -1e20}};
  rig.live(4 * kSecond_ms);
  for (const char* name : {"VISO_SCALE", "VISO_TYPE", "VISO_ORIENT"})
    EXPECT_EQ(rig.answers().parameter(name), std::nullopt) << name;
}

TEST(ControllerSurvey, SeesAParameterThatIsSetMeanwhile) {
  Rig rig;
  rig.controller.parameters = {{"EKF2_EV_CTRL", 0}, {"EKF2_EV_QMIN", 1}};
  rig.live(5 * kSecond_ms);
  EXPECT_EQ(rig.answers().parameter("EKF2_EV_CTRL"), 0.0);
  rig.controller.parameters["EKF2_EV_CTRL"] = 15;
  rig.live(12 * kSecond_ms);
  EXPECT_EQ(rig.answers().parameter("EKF2_EV_CTRL"), 15.0);
}

TEST(ControllerSurvey, AsksAnewAfterARestart) {
  Rig rig;
  rig.controller.parameters = {{"EKF2_EV_CTRL", 15}};
  rig.live(4 * kSecond_ms);
  rig.controller.is_silent = true;
  rig.live(4 * kSecond_ms);
  rig.controller.is_silent = false;
  rig.controller.parameters = {{"EKF2_EV_CTRL", 0}};
  rig.live(2 * kSecond_ms);
  EXPECT_EQ(rig.answers().parameter("EKF2_EV_CTRL"), 0.0);
}

TEST(ControllerSurvey, TakesTheFiltersStatus) {
  Rig rig;
  rig.live(kSecond_ms);
  rig.line.peer.send(EstimatorStatus{.vel_ratio = 0.1F, .pos_horiz_ratio = 0.2F, .mag_ratio = NAN}, kController);
  EstimatorSensorFusionStatus fusion;
  fusion.intended[2] = 1;
  rig.line.peer.send(fusion, kController);
  rig.live(100);
  const FilterStatus f = rig.answers().filter;
  EXPECT_FLOAT_EQ(f.velocity, 0.1F);
  EXPECT_TRUE(std::isnan(f.heading));
  EXPECT_EQ(f.vision_intended, 1);
  EXPECT_EQ(f.vision_active, 0);
  rig.line.peer.send(EstimatorStatus{.vel_ratio = 0.7F}, {1, 100});
  rig.live(100);
  EXPECT_FLOAT_EQ(rig.answers().filter.velocity, 0.1F) << "of a camera";
}

// PX4 1.18: the first origin, set while it fuses odometry, throws its position away unless vision pauses for 0.6 s.
struct Pause {
  std::size_t during = 0, after = 0;  ///< odometry in the 0.6 s after the origin, and in the second after that
};
Pause pause_at_origin(Rig& rig) {
  rig.flies = true;
  rig.live(5 * kSecond_ms);
  rig.line.peer.send(GpsGlobalOrigin{.latitude = 473'000'000, .longitude = 85'000'000}, kController);
  rig.live(10);
  const std::size_t before = rig.odometry();
  rig.live(580);
  Pause pause;
  pause.during = rig.odometry() - before;
  rig.live(kSecond_ms);
  pause.after = rig.odometry() - before - pause.during;
  return pause;
}

TEST(MavlinkLink, PausesForTheFirstOrigin) {
  Rig rig;
  rig.controller.parameters = {{"EKF2_EV_CTRL", 7}};
  const Pause first = pause_at_origin(rig), second = pause_at_origin(rig);
  EXPECT_EQ(first.during, 0U);
  EXPECT_GE(first.after, 38U);
  EXPECT_GE(second.during, 20U) << "a second one does no harm";
  EXPECT_EQ(rig.link.counts().origin_pauses, 1U);
}

TEST(MavlinkLink, PausesForNoOriginThatWasThereBeforeTheLineWasLost) {
  Rig rig;
  rig.controller.parameters = {{"EKF2_EV_CTRL", 7}};
  pause_at_origin(rig);
  rig.controller.is_silent = true;  // or its line is
  rig.live(4 * kSecond_ms);
  rig.controller.is_silent = false;
  EXPECT_GE(pause_at_origin(rig).during, 20U);
  EXPECT_EQ(rig.link.counts().origin_pauses, 1U);
}

TEST(MavlinkLink, PausesForNoOriginThatDoesNoHarm) {
  const auto during = [](Rig& rig, double control) {
    rig.controller.parameters = {{"EKF2_EV_CTRL", control}};
    return pause_at_origin(rig).during;
  };
  Rig older(AskedController::kIsPx4, {1, 17, 0}), ardupilot(AskedController::kIsArduPilot, {4, 7, 0}), own_map;
  EXPECT_GE(during(older, 7), 20U);
  EXPECT_GE(during(ardupilot, 7), 20U);
  EXPECT_GE(during(own_map, 15), 20U) << "LOCAL_FRD is its map";
  Rig north_rig(AskedController::kIsPx4, {1, 18, 0}, north(0)), old_origin;
  EXPECT_EQ(during(north_rig, 15), 0U);
  old_origin.controller.has_origin = true;  // known before odometry flows
  old_origin.live(2 * kSecond_ms);
  EXPECT_GE(during(old_origin, 7), 20U);
}

// ---- others on the line ----

struct Other {
  const char* name;
  Address address;
  Heartbeat heartbeat;
};
const std::array<Other, 5> kOthers{{{"camera", {1, 100}, {.type = 30, .autopilot = 3}},
                                    {"gimbal", {1, 154}, {.type = 26, .autopilot = 0}},
                                    {"companion", {1, 191}, {.type = 18, .autopilot = 12}},
                                    {"vehicle", {2, 1}, {.type = 2, .autopilot = 12}},
                                    {"station", {255, 190}, {.type = 6, .autopilot = 8}}}};

/// They begin one after the other, in `order`; number 5 is the controller. It restarts once, with a clock of its own.
struct Crowd {
  Crowd(std::vector<int> order, std::int64_t apart_ms)
      : rig(AskedController::kIsPx4, {1, 17, 0}, {}, ImuDeviceConfig{}) {
    for (std::size_t i = 0; i < order.size(); ++i)
      begins_ms[static_cast<std::size_t>(order[i])] = static_cast<std::int64_t>(i) * apart_ms;
    rig.controller.is_silent = true;
    begin_ns = rig.line.now_ns();
  }
  std::int64_t now_ms() const { return (rig.line.now_ns() - begin_ns) / kMs; }
  void live(std::int64_t ms, const std::function<bool()>& done) {
    const std::int64_t until_ms = now_ms() + ms;
    while (now_ms() < until_ms && !done()) {
      for (std::size_t i = 0; i < kOthers.size(); ++i)
        if (now_ms() >= begins_ms[i] && (now_ms() - begins_ms[i]) % kSecond_ms == 0)
          rig.line.peer.send(kOthers[i].heartbeat, kOthers[i].address);
      rig.live(5);
    }
  }
  void boot() {
    rig.controller.is_silent = false;
    rig.controller.imu_hz = 0;  // it has forgotten
    rig.controller.booted_ns = rig.line.now_ns() - 3'000 * kMs;
    rig.next_heartbeat_ns = rig.line.now_ns();
  }
  /// From the controller's first heartbeat to its first reading that is used; 10 s: none came.
  double seconds_to_readings() {
    const std::uint64_t before = rig.link.state().imu.readings;
    const std::int64_t from_ms = now_ms();
    live(10 * kSecond_ms, [&] { return rig.link.state().imu.readings > before; });
    return 1e-3 * static_cast<double>(now_ms() - from_ms);
  }

  Rig rig;
  std::array<std::int64_t, 6> begins_ms{};
  std::int64_t begin_ns = 0;
};

TEST(MavlinkLink, FindsTheControllerInAnyCrowd) {
  double slowest_start = 0, slowest_restart = 0;
  std::mt19937 chance(5);
  for (int round = 0; round < 24; ++round) {
    std::vector<int> order(6);
    std::iota(order.begin(), order.end(), 0);
    std::shuffle(order.begin(), order.end(), chance);
    Crowd crowd(order, 200 * (round % 8));  // together, up to 1.4 s apart: the last ones come when a camera was taken
    crowd.live(crowd.begins_ms[5], [] { return false; });
    crowd.boot();
    const double start = crowd.seconds_to_readings();
    EXPECT_LT(start, 2) << testing::PrintToString(order) << " " << round;
    crowd.live(2 * kSecond_ms, [] { return false; });
    crowd.rig.controller.is_silent = true;
    crowd.live(kSecond_ms * (1 + round % 9), [] { return false; });
    crowd.boot();
    const double restart = crowd.seconds_to_readings();
    EXPECT_LT(restart, 2) << testing::PrintToString(order) << " " << round;
    EXPECT_EQ(crowd.rig.link.state().peer.address.component, 1);
    slowest_start = std::max(slowest_start, start);
    slowest_restart = std::max(slowest_restart, restart);
  }
  RecordProperty("slowest_start_ms", static_cast<int>(1e3 * slowest_start));
  RecordProperty("slowest_restart_ms", static_cast<int>(1e3 * slowest_restart));
  std::printf("slowest start %.2f s, restart %.2f s\n", slowest_start, slowest_restart);
}

}  // namespace
}  // namespace epiline::mavlink
