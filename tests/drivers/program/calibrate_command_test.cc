// `epiline calibrate` as a user meets it. How good its figures are: tests/drivers/study/calibrate, tests/flights.
#include <gtest/gtest.h>

#include <string>

#include "tests/drivers/program/program.h"
#include "tests/support/recorded_data.h"

namespace epiline {
namespace {

class CalibrateCommand : public testing::Test {
 protected:
  void SetUp() override { fs::remove_all(scratch()); }
  void TearDown() override { fs::remove_all(scratch()); }
};

TEST_F(CalibrateCommand, WantsAFolderForWhatAConfigurationWillName) {
  write(scratch() / "flight.toml", "");
  expect_one_line(run("calibrate nothing --config '" + (scratch() / "flight.toml").string() + "'"), 2,
                  {"--config without --out", "a folder"});
  EXPECT_EQ(read(scratch() / "flight.toml"), "");
}

TEST_F(CalibrateCommand, SetsWhatItFoundInTheConfiguration) {
  const fs::path recording = test::recorded_data("imu_april_tracks");
  if (!fs::exists(recording)) GTEST_SKIP() << "no recording " << recording;
  const fs::path config = scratch() / "flight.toml";
  write(config, "# mine\n[camera]\n#calibration = \"calibration/camera.yaml\"\n");
  const Outcome r = run("calibrate '" + recording.string() + "' --duration 5.5 --hold-lens --out '" +
                        (scratch() / "found").string() + "' --config '" + config.string() + "'");
  ASSERT_EQ(r.exit_code, 0) << r.err;
  EXPECT_NE(r.out.find("set in " + config.string()), std::string::npos) << r.out;
  const std::string text = read(config);
  EXPECT_NE(text.find("# mine"), std::string::npos);
  EXPECT_NE(text.find("found/camera.yaml\""), std::string::npos) << text;
  EXPECT_NE(text.find("found/imu.yaml\""), std::string::npos) << text;
  EXPECT_EQ(run("config --check '" + config.string() + "'").exit_code, 0);
  EXPECT_TRUE(fs::exists(scratch() / "found/camera.yaml") && fs::exists(scratch() / "flight.toml.bak"));
}

}  // namespace
}  // namespace epiline
