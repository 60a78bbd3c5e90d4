// What is said of a flight controller's parameters. Each wrong set and what it does: docs/flight-controller.md.
#include "drivers/program/live/controller_advice.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "tests/drivers/links/mavlink/right_parameters.h"

namespace epiline {
namespace {

using mavlink::ControllerAnswers;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using Parameters = mavlink::RightParameters;
using mavlink::kArduPilotRight;
using mavlink::kPx4Right;

ControllerAnswers answers(std::uint8_t autopilot, std::uint16_t version, Parameters right, const Parameters& changes) {
  for (const auto& [name, value] : changes) right[name] = value;
  ControllerAnswers a;
  a.autopilot = autopilot;
  a.version = version;
  a.is_complete = true;
  const auto names = mavlink::parameters_of(autopilot);
  for (const auto& [name, value] : right) {
    const auto found = std::find(names.begin(), names.end(), name);
    EXPECT_NE(found, names.end()) << name << " is not asked for";
    if (found != names.end()) a.parameters[static_cast<std::size_t>(found - names.begin())] = value;
  }
  return a;
}
ControllerAnswers px4(std::uint16_t version, const Parameters& changes = {}) {
  return answers(mavlink::kPx4, version, kPx4Right, changes);
}
ControllerAnswers ardupilot(std::uint16_t version, const Parameters& changes = {}) {
  return answers(mavlink::kArduPilot, version, kArduPilotRight, changes);
}
MavlinkConfig odometry() { return {}; }
MavlinkConfig vision_position() {
  MavlinkConfig config;
  config.message = 1;
  return config;
}
std::vector<std::string> said(const ControllerAnswers& a, const MavlinkConfig& config = odometry()) {
  std::vector<std::string> all;
  for (const DeviceAdvice& advice : advice_of(a, config)) all.push_back(advice.text + "; " + advice.remedy);
  return all;
}
/// One sentence, with the parameter and its value first, that ends with the cure.
auto one(const char* fault, const char* cure) {
  return ElementsAre(testing::AllOf(testing::StartsWith(fault), HasSubstr(cure)));
}

TEST(ControllerAdvice, OfRightParametersNothingIsSaid) {
  for (const int version : {114, 115, 116, 117, 118, 119})
    EXPECT_THAT(said(px4(static_cast<std::uint16_t>(version))), IsEmpty()) << version;
  for (const int version : {405, 406, 407, 408})
    EXPECT_THAT(said(ardupilot(static_cast<std::uint16_t>(version))), IsEmpty()) << version;
  EXPECT_THAT(said(px4(118, {{"EKF2_SENS_EN", 8191}, {"EKF2_EVA_NOISE", 0.1F}})), IsEmpty());
  EXPECT_THAT(said(px4(118, {{"EKF2_EV_QMIN", 0}}), vision_position()), IsEmpty());
  EXPECT_THAT(said(ardupilot(407, {{"VISO_QUAL_MIN", 0}, {"EK3_SRC1_VELXY", 0}}), vision_position()), IsEmpty());
  EXPECT_THAT(said(px4(117, {{"EKF2_EV_CTRL", 7}, {"EKF2_MAG_TYPE", 0}, {"SYS_HAS_MAG", 1}})), IsEmpty())
      << "with a compass";
  MavlinkConfig north;
  north.frame = 1;
  EXPECT_THAT(said(px4(118, {{"EKF2_MAG_TYPE", 0}, {"SYS_HAS_MAG", 1}}), north), IsEmpty()) << "the headings agree";
  EXPECT_THAT(said(ardupilot(407, {{"VISO_TYPE", 3}, {"EK3_SRC1_YAW", 1}, {"COMPASS_ENABLE", 1}})), IsEmpty());
}

TEST(ControllerAdvice, NamesEachWrongParameterWithItsCure) {
  EXPECT_THAT(said(px4(117, {{"EKF2_EV_CTRL", 0}})), one("EKF2_EV_CTRL is 0: ", "set EKF2_EV_CTRL to 15"));
  EXPECT_THAT(said(px4(117, {{"EKF2_EV_CTRL", 7}})), one("EKF2_EV_CTRL is 7: ", "set EKF2_EV_CTRL to 15"));
  EXPECT_THAT(said(px4(117, {{"EKF2_EV_CTRL", 11}})), one("EKF2_EV_CTRL is 11: ", "set EKF2_EV_CTRL to 15"));
  EXPECT_THAT(said(px4(117, {{"EKF2_EV_CTRL", 13}})), one("EKF2_HGT_REF is 3: ", "set EKF2_EV_CTRL to 15"));
  EXPECT_THAT(said(px4(118, {{"EKF2_SENS_EN", 8183}})), one("EKF2_SENS_EN is 8183: ", "add 8 to EKF2_SENS_EN"));
  EXPECT_THAT(said(px4(118), vision_position()), one("EKF2_EV_QMIN is 1: ", "set EKF2_EV_QMIN to 0"));
  EXPECT_THAT(said(px4(117, {{"EKF2_EVA_NOISE", 0.1F}})), one("EKF2_EVA_NOISE is 0.1: ", "set EKF2_EVA_NOISE to 0.05"));
  EXPECT_THAT(said(px4(117, {{"EKF2_EV_NOISE_MD", 1}})), one("EKF2_EV_NOISE_MD is 1: ", "set EKF2_EV_NOISE_MD to 0"));
  EXPECT_THAT(said(px4(118, {{"EKF2_MAG_TYPE", 0}, {"SYS_HAS_MAG", 1}})), one("EKF2_MAG_TYPE is 0: ", "to 5"));
  EXPECT_THAT(said(px4(118, {{"EKF2_EV_DELAY", 175}})), one("EKF2_EV_DELAY is 175: ", "set EKF2_EV_DELAY to 0"));
  EXPECT_THAT(said(px4(117, {{"EKF2_EN", 0}})), one("EKF2_EN is 0: ", "set EKF2_EN to 1"));
  EXPECT_THAT(said(ardupilot(406, {{"VISO_TYPE", 0}})), one("VISO_TYPE is 0: ", "set VISO_TYPE to 1"));
  EXPECT_THAT(said(ardupilot(407), vision_position()), one("VISO_QUAL_MIN is 1: ", "set VISO_QUAL_MIN to 0"));
  EXPECT_THAT(said(ardupilot(407, {{"EK3_SRC1_POSXY", 3}})), one("EK3_SRC1_POSXY is 3: ", "to 6"));
  EXPECT_THAT(said(ardupilot(407, {{"EK3_SRC1_VELXY", 0}})), one("EK3_SRC1_VELXY is 0: ", "to 6"));
  EXPECT_THAT(said(ardupilot(407, {{"EK3_SRC1_YAW", 0}})), one("EK3_SRC1_YAW is 0: ", "to 6"));
  EXPECT_THAT(said(ardupilot(407, {{"EK3_SRC1_YAW", 1}, {"COMPASS_ENABLE", 1}})),
              one("VISO_TYPE is 1: the compass points north", "set VISO_TYPE to 3"));
  EXPECT_THAT(said(ardupilot(406, {{"GPS1_TYPE", 1}})), one("GPS1_TYPE is 1: before 4.7", "set GPS1_TYPE to 0"));
  EXPECT_THAT(said(ardupilot(407, {{"GPS1_TYPE", 1}})), IsEmpty());
  EXPECT_THAT(said(ardupilot(407, {{"VISO_ORIENT", 4}})), one("VISO_ORIENT is 4: ", "set VISO_ORIENT to 0"));
  EXPECT_THAT(said(ardupilot(407, {{"AHRS_EKF_TYPE", 10}})), one("AHRS_EKF_TYPE is 10: ", "set AHRS_EKF_TYPE to 3"));
}

TEST(ControllerAdvice, KnowsOldReleasesAndBuildsWithoutOdometry) {
  EXPECT_THAT(said(px4(113)), one("PX4 1.13 is older", "use PX4 1.14 or later"));
  ControllerAnswers small = ardupilot(407);
  small.parameters = ControllerAnswers::none();
  small.parameters[0] = 3;
  EXPECT_THAT(said(small), one("ArduPilot 4.7 has no VISO_TYPE: ", "flash a build with visual odometry"));
  EXPECT_THAT(said(ControllerAnswers{}), IsEmpty()) << "it has not answered";
  EXPECT_EQ(survey_note(px4(117)), "PX4 1.17 answered: 11 parameters compared");
  ControllerAnswers silent = px4(0);
  silent.parameters = ControllerAnswers::none();
  EXPECT_EQ(survey_note(silent), "PX4 answers no question: its parameters are not compared");
}

// A release, or a parameter that is asked for, which no guide mentions.
TEST(ControllerAdvice, GuidesNameWhatIsAskedAndJudged) {
  const auto text_of = [](const char* page) {
    std::ifstream in(std::filesystem::path(EPILINE_SOURCE) / "docs" / page);
    return std::string(std::istreambuf_iterator<char>(in), {});
  };
  const std::string hil = text_of("hil.md"), guide = text_of("flight-controller.md");
  for (const mavlink::ControllerRelease& r : mavlink::kControllerReleases)
    EXPECT_THAT(hil, HasSubstr("`" + std::string(r.option) + "`"));
  for (const std::uint8_t autopilot : {mavlink::kPx4, mavlink::kArduPilot})
    for (const std::string_view name : mavlink::parameters_of(autopilot))
      EXPECT_TRUE(name.starts_with("EK3_SRC1_") || guide.find("`" + std::string(name) + "`") != std::string::npos)
          << name;
}

TEST(ControllerAdvice, SaysWhatTheFilterUses) {
  const HostStamp now{100'000'000'000};
  mavlink::LinkState link;
  link.answers = px4(117);
  link.answers.filter = {.at = now, .velocity = 0.1F, .position = 0.2F, .height = 0.1F, .heading = NAN};
  EXPECT_EQ(use_of(link, now), "") << "nothing is sent";
  link.sending_since = now - Span::from_seconds(5);
  EXPECT_EQ(use_of(link, now), "PX4 1.17 uses position, velocity and height, not yaw");
  EXPECT_EQ(use_of(link, now + Span::from_seconds(11)), "") << "an old answer";
  link.answers.filter.heading = 0.3F;
  EXPECT_EQ(use_of(link, now), "PX4 1.17 uses position, velocity, height and yaw");
  link.answers.filter.vision_active = 0;
  EXPECT_EQ(use_of(link, now), "PX4 1.17 uses nothing of the odometry");
  link.answers = ardupilot(407, {{"EK3_SRC1_YAW", 1}});
  link.answers.filter = {.at = now, .flags = 1 | 2 | 4 | 8 | 32};
  EXPECT_EQ(use_of(link, now), "ArduPilot 4.7 uses position, velocity and height, not yaw");
  link.answers.filter.flags = 1 | 4 | 32 | 128;
  EXPECT_EQ(use_of(link, now), "ArduPilot 4.7 uses nothing of the odometry");
}

}  // namespace
}  // namespace epiline
