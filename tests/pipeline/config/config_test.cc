#include "pipeline/config/config.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <set>
#include <vector>

namespace epiline {
namespace {

/// What such a file makes of a configuration.
Config read(const std::string& toml, Config config = {}) {
  const auto file = ConfigFile::parse(toml, "f.toml");
  EXPECT_TRUE(file) << file.error().text();
  if (file) file->apply(config);
  return config;
}

TEST(Config, PrintedDefaultsReadBackAsThemselves) {
  const std::string text = to_toml(Config{});
  Config config;
  config.estimator.keyframes = 3;
  config.tracker.max_features = 70;
  config.estimator.zero_motion = false;
  config.devices.camera.shutter = 1;
  EXPECT_EQ(to_toml(read(text, config)), text);
}

TEST(Config, EveryChoiceIsReadByTheNameItPrints) {
  for (std::size_t i = 0; i < std::size(kImuDriverNames); ++i) {
    const std::string line = fmt::format("driver = \"{}\"\n", kImuDriverNames[i]);
    const Config config = read("[imu]\n" + line);
    EXPECT_EQ(config.devices.imu.driver, static_cast<int>(i));
    EXPECT_NE(to_toml(config).find(line), std::string::npos);
  }
}

TEST(Config, EveryParameterIsNamedOnce) {
  std::set<std::string> names;
  for (const Parameter& p : parameters()) {
    EXPECT_TRUE(names.insert(p.name).second) << p.name;
    EXPECT_NE(p.name.find('.'), std::string::npos);
    EXPECT_FALSE(p.text.empty()) << p.name;
  }
}

TEST(Config, SetsWhatTheFileSaysAndNothingElse) {
  Config config;
  config.estimator.solve_interval_s = 0.3;
  config = read("[estimator]\nkeyframes = 7\npixel_sigma = 3\n[imu]\ncalibration = \"a.yaml\"\n", config);
  EXPECT_EQ(config.estimator.keyframes, 7);
  EXPECT_DOUBLE_EQ(config.estimator.pixel_sigma, 3);
  EXPECT_EQ(config.imu_calibration, "a.yaml");
  EXPECT_EQ(config.estimator.solve_interval_s, 0.3);
}

TEST(Config, SingleSettingsWinOverTheFile) {
  auto file = ConfigFile::parse("[tracker]\nmax_features = 70\n[estimator]\nkeyframes = 7\n", "f.toml");
  ASSERT_TRUE(file);
  for (const char* const set :
       {"tracker.max_features=90", "camera.stamp_edge=falling", "camera.device=a=b", "realtime.lock_memory=false"})
    EXPECT_TRUE(file->set(set)) << set;
  Config config;
  file->apply(config);
  EXPECT_EQ(config.tracker.max_features, 90);
  EXPECT_EQ(config.estimator.keyframes, 7);
  EXPECT_EQ(config.devices.camera.stamp_edge, 1);
  EXPECT_EQ(config.devices.camera.device, "a=b");
  EXPECT_FALSE(config.realtime.lock_memory);
}

TEST(Config, AFileIsReadWithTheSettingsOfTheCommandLine) {
  const std::filesystem::path path = std::filesystem::path(testing::TempDir()) / "epiline_config_test.toml";
  std::ofstream(path) << "[tracker]\nmax_features = 70\n[estimator]\nkeyframes = 7\n";
  const auto file = ConfigFile::read(path, {"tracker.max_features=90"});
  ASSERT_TRUE(file) << file.error().text();
  Config config;
  file->apply(config);
  EXPECT_EQ(config.tracker.max_features, 90);
  EXPECT_EQ(config.estimator.keyframes, 7);
  const auto wrong = ConfigFile::read(path, {"tracker.max_features=0"});
  ASSERT_FALSE(wrong);
  EXPECT_EQ(wrong.error().text(), "--set tracker.max_features=0: \"0\"; expected an integer from 1 to 400");
  std::ofstream(path) << "[tracker]\nmax_features = 0\n";
  const auto named = ConfigFile::read(path, {});
  ASSERT_FALSE(named);
  EXPECT_EQ(named.error().text().rfind(path.string() + ":2: ", 0), 0u) << named.error().text();
  std::filesystem::remove(path);
  const auto missing = ConfigFile::read(path, {});
  ASSERT_FALSE(missing);
  EXPECT_NE(missing.error().text().find(path.string()), std::string::npos);
  const auto none = ConfigFile::read({}, {"estimator.keyframes=5"});
  ASSERT_TRUE(none);
  none->apply(config);
  EXPECT_EQ(config.estimator.keyframes, 5);
}

TEST(Config, ASingleSettingThatIsWrongIsExplained) {
  ConfigFile file;
  const auto why = [&](const char* set) {
    const Status status = file.set(set);
    return status ? std::string("taken") : status.error().text();
  };
  EXPECT_EQ(why("tracker.max_features"), "--set tracker.max_features: no value; expected SECTION.KEY=VALUE");
  EXPECT_EQ(
      why("tracker.max_feature=3"),
      "--set tracker.max_feature=3: unknown setting \"tracker.max_feature\"; expected \"tracker.max_features\", or "
      "a name that `epiline config` lists");
  EXPECT_EQ(why("tracker.max_features=many"),
            "--set tracker.max_features=many: \"many\"; expected an integer from 1 to 400");
  EXPECT_NE(why("tracker.max_features=3\n[camera]"), "taken");
  EXPECT_NE(why("tracker.max_features=3\nother=4"), "taken");
  EXPECT_NE(why("=3"), "taken");
}

// Limits that mean something: a full turn, the numbers that MAVLink and the kernel have, none at all.
TEST(Config, LimitsThatTheFieldSetsAreTaken) {
  struct Limit {
    const char *name, *taken, *refused;
  };
  for (const Limit& l : {Limit{"body.yaw_pitch_roll_deg", "180,-180,180", "0,0,180.001"},
                         {"body.yaw_pitch_roll_deg", "-180,180,-180", "0,-180.001,0"},
                         {"mavlink.origin", "90,-180,-1000", "90.001,0,0"},
                         {"mavlink.origin", "-90,180,10000", "0,-180.001,0"},
                         {"mavlink.origin", "[0, 0, 0]", "0,0,10001"},
                         {"mavlink.system", "255", "256"},
                         {"mavlink.system", "1", "0"},
                         {"mavlink.component", "255", "256"},
                         {"mavlink.component", "1", "0"},
                         {"estimator.solve_interval_s", "0.4", "0.401"},
                         {"estimator.pixel_sigma", "10", "10.001"},
                         {"realtime.priority", "99", "100"},
                         {"realtime.priority", "0", "-1"},
                         {"realtime.cpus", "{ imu = 0, estimate = 1023 }", "{ imu = -1 }"},
                         {"realtime.cpus", "{}", "{ imu = 1024 }"},
                         {"recorder.keep", "0", "-1"}}) {
    ConfigFile file;
    EXPECT_TRUE(file.set(std::string(l.name) + "=" + l.taken)) << l.name << " = " << l.taken;
    EXPECT_FALSE(file.set(std::string(l.name) + "=" + l.refused)) << l.name << " = " << l.refused;
  }
}

TEST(Config, NamedValuesKeepTheirOrderHoweverTheyAreWritten) {
  for (const char* const text : {"[camera]\ncontrols = { zoom = 3, auto_exposure = 1, \"a b\" = -7 }\n",
                                 "[camera.controls]\nzoom = 3\nauto_exposure = 1\n\"a b\" = -7\n"}) {
    const Config config = read(text);
    for (const Config& c : {config, read(to_toml(config))}) {
      const std::vector<NamedValue>& controls = c.devices.camera.controls;
      ASSERT_EQ(controls.size(), 3u);
      EXPECT_EQ(controls[0].name, "zoom");
      EXPECT_EQ(controls[1].name, "auto_exposure");
      EXPECT_EQ(controls[2].name, "a b");
      EXPECT_EQ(controls[2].value, -7);
    }
  }
}

TEST(Config, SeveralNumbersAndSignalsReadBack) {
  ConfigFile file;
  for (const char* const set : {"mavlink.origin=47.397742,-8.545594,488", "wheel.position_m=[1, 2.5, -3]",
                                "wheel.signal=0x1a0 16|12@1+ (0.25,-3)", "realtime.cpus={ estimate = 3, imu = 2 }"}) {
    const Status status = file.set(set);
    EXPECT_TRUE(status) << status.error().text();
  }
  Config config;
  file.apply(config);
  for (const Config& c : {config, read(to_toml(config))}) {
    EXPECT_EQ(c.devices.mavlink.origin, (std::array{47.397742, -8.545594, 488.}));
    EXPECT_EQ(c.devices.wheel.position_m, (std::array{1., 2.5, -3.}));
    const BusSignal& signal = c.devices.wheel.signal;
    EXPECT_EQ(to_text(signal), "416 16|12@1+ (0.25,-3)");
    ASSERT_EQ(c.realtime.cpus.size(), 2U);
    EXPECT_EQ(settings_of(FlightThread::kEstimate, c.realtime).cpu, 3);
    EXPECT_EQ(settings_of(FlightThread::kImu, c.realtime).cpu, 2);
    EXPECT_EQ(settings_of(FlightThread::kTrack, c.realtime).cpu, -1);
  }
}

TEST(Config, ThePrioritiesOfAllThreadsFollowTheFirstOnes) {
  for (const auto& [first, expected] : std::map<int, std::vector<int>>{
           {80, {80, 70, 65, 60, 60}}, {99, {99, 89, 84, 79, 79}}, {12, {12, 2, 1, 1, 1}}, {0, {0, 0, 0, 0, 0}}}) {
    RealtimeConfig config;
    config.priority = first;
    for (std::size_t i = 0; i < expected.size(); ++i)
      EXPECT_EQ(settings_of(static_cast<FlightThread>(i), config).priority, expected[i]) << first;
  }
}

TEST(Config, OtherCamerasAreListedWhereTheyAreSet) {
  EXPECT_EQ(to_toml(Config{}).find("\n[third_camera]"), std::string::npos);
  Config config;
  config.devices.other_cameras[1].free_running = true;
  const std::string text = to_toml(config);
  EXPECT_NE(text.find("\n[third_camera]"), std::string::npos);
  EXPECT_EQ(text.find("\n[fourth_camera]"), std::string::npos);
  EXPECT_TRUE(read(text).devices.other_cameras[1].free_running);
}

TEST(Config, TextsOfAnySortReadBack) {
  for (const char* const text :
       {"\n", "\r\n", "a \"b\" \\ c", "three ''' quotes", "\t\x7f\x01", "Gr\xc3\xbc\xc3\x9f"}) {
    Config config;
    config.recorder.folder = text;
    EXPECT_EQ(read(to_toml(config)).recorder.folder, text);
  }
}

struct BadFile {
  const char *text, *complaint;
};
class BadConfig : public testing::TestWithParam<BadFile> {};

TEST_P(BadConfig, NamesFileLineAndExpectation) {
  const auto file = ConfigFile::parse(GetParam().text, "f.toml");
  ASSERT_FALSE(file);
  EXPECT_EQ(file.error().text().rfind(GetParam().complaint, 0), 0u) << file.error().text();
}

INSTANTIATE_TEST_SUITE_P(
    All, BadConfig,
    testing::Values(
        BadFile{"[estimator]\n\nkeyframes = 21\n",
                "f.toml:3: estimator.keyframes = 21; expected an integer from 2 to 20"},
        BadFile{"[camera]\ncontrols = { gain = \"high\" }\n",
                "f.toml:2: camera.controls = { gain = 'high' }; expected { name = integer, ... }"},
        BadFile{"[estimator]\nkeyframes = 7.5\n", "f.toml:2: estimator.keyframes = 7.5; expected an integer"},
        BadFile{"[estimator]\npixel_sigma = \"wide\"\n",
                "f.toml:2: estimator.pixel_sigma = \"wide\"; expected a number from 0.01 to 10 px"},
        BadFile{"[estimator]\npixel_sigma = nan\n", "f.toml:2: estimator.pixel_sigma = nan; expected a number"},
        BadFile{"[estimator]\nzero_motion = 1\n", "f.toml:2: estimator.zero_motion = 1; expected true or false"},
        BadFile{"[wheel]\nposition_m = [1, 2]\n",
                "f.toml:2: wheel.position_m = [1, 2]; expected 3 numbers from -100 to 100 m"},
        BadFile{"[wheel]\nposition_m = [1, 2, nan]\n", "f.toml:2: wheel.position_m = [1, 2, nan]; expected 3"},
        BadFile{"[mavlink]\norigin = 47\n",
                "f.toml:2: mavlink.origin = 47; expected 3 numbers from -90 to 90, -180 to 180, -1000 to 10000 deg, "
                "deg, m"},
        BadFile{"[realtime]\ncpus = { gpu = 1 }\n",
                "f.toml:2: realtime.cpus = { gpu = 1 }; expected { name = integer, ... }; names imu, capture, publish, "
                "track, estimate; integers from 0 to 1023"},
        BadFile{"[realtime]\npriority_imu = 70\n",
                "f.toml:2: unknown key \"realtime.priority_imu\"; expected realtime.priority = 80"},
        BadFile{"[body]\nroll_deg = 180\n",
                "f.toml:2: unknown key \"body.roll_deg\"; expected body.yaw_pitch_roll_deg = [yaw, pitch, roll]"},
        BadFile{"[wheel]\nscale_m_s = 0.01\n",
                "f.toml:2: unknown key \"wheel.scale_m_s\"; expected wheel.signal, such as \"291 7|16@0- (0.01,0)\""},
        BadFile{"[estimator]\nvisual_factor = \"track\"\n",
                "f.toml:2: unknown key \"estimator.visual_factor\"; expected nothing in its place: flights use the "
                "factor track, with which `epiline-study replay --visual-factor` compares others"},
        BadFile{"[camera]\nshutter = \"none\"\n", "f.toml:2: camera.shutter = \"none\"; expected \"global\" or"},
        BadFile{"[estimator]\nkeyframe = 7\n", "f.toml:2: unknown key \"estimator.keyframe\""},
        BadFile{"[estimatr]\nkeyframes = 7\n", "f.toml:1: unknown section \"estimatr\""},
        BadFile{"estimator = 3\n", "f.toml:1: \"estimator\" is not a section"},
        BadFile{"[wheel]\nsignal = 291\n",
                "f.toml:2: wheel.signal = 291; expected identifier and signal as in a DBC file, \"ID START|LENGTH@"},
        BadFile{"[wheel]\nsignal = \"1 504|16@1+ (1,0)\"\n",
                "f.toml:2: wheel.signal = \"1 504|16@1+ (1,0)\"; expected a signal of 1 to 64 bits within 64 bytes"},
        BadFile{"[camera]\n# Gr\xc3\xb6\xc3\x9f"
                "e, caf\xe9\n",
                "f.toml:2: holds the byte 0xE9, which is not UTF-8 ('\xc3\xa9' in Latin-1); expected a text in UTF-8: "
                "save"},
        BadFile{"[camera]\n# \x80\n", "f.toml:2: holds the byte 0x80, which is not UTF-8; expected a text in UTF-8"},
        BadFile{"[estimator]\nkeyframes = \n", "f.toml:2: "}));

TEST(Config, APathMayBeginAtTheUsersHome) {
  setenv("HOME", "/home/ann", 1);
  const Config config = read("[camera]\ncalibration = \"~/cam.yaml\"\n[imu]\ncalibration = \"~ann/imu.yaml\"\n");
  EXPECT_EQ(config.camera_calibration, "/home/ann/cam.yaml");
  EXPECT_EQ(config.imu_calibration, "~ann/imu.yaml");
}

TEST(Config, Utf16WithoutAMarkIsNamed) {
  const auto file = ConfigFile::parse(std::string_view("[\0c\0]\0", 6), "f.toml");
  ASSERT_FALSE(file);
  EXPECT_EQ(file.error().found, "looks like UTF-16");
}

}  // namespace
}  // namespace epiline
