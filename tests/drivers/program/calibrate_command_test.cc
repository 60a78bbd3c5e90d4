// `epiline calibrate` as a user meets it. How good its figures are: tests/drivers/study/calibrate, tests/flights.
#include <gtest/gtest.h>

#include <string>

#include "tests/drivers/program/program.h"
#include "tests/support/apriltag.h"
#include "tests/support/recorded_data.h"

namespace epiline {
namespace {

class CalibrateCommand : public CommandTest {};

TEST_F(CalibrateCommand, WantsAFolderForWhatAConfigurationWillName) {
  expect_one_line(run("calibrate nothing" + with_config("")), 2, {"--config without --out", "a folder"});
  EXPECT_EQ(read(scratch() / "flight.toml"), "");
}

/// Each before a device is opened: nobody should have waved for nothing.
TEST_F(CalibrateCommand, WithoutARecordingItNeedsDevicesAndABoard) {
  const std::string board = in_quotes(scratch() / "board.yaml"), out = " --out " + in_quotes(scratch() / "out");
  const std::string config = with_config(kAbsentDevices);
  write(scratch() / "board.yaml", "target_type: 'checkerboard'\n");
  expect_one_line(run("calibrate --board " + board), 2, {"nothing to calibrate from", "--config FILE"});
  expect_one_line(run("calibrate" + config), 2, {"--config without --out"});
  expect_one_line(run("calibrate" + config + out), 2, {"no board", "--board FILE"});
  expect_one_line(run("calibrate" + config + out + " --board " + board), 2, {"not a board of AprilTags"});
  expect_one_line(run("calibrate nothing --set camera.rate_hz=20"), 2, {"--set with a recording"});
  const Outcome drawn = run("board --force --kind charuco --out " + in_quotes(scratch() / "board.pdf"));
  if (test::lacks_apriltag(drawn.err)) GTEST_SKIP() << drawn.err;
  ASSERT_EQ(drawn.exit_code, 0) << drawn.err;
  const Outcome r = run("calibrate --json" + config + out + " --board " + board);
  EXPECT_EQ(r.exit_code, 1);
  EXPECT_NE(r.err.find("iio:device77"), std::string::npos) << r.err;
  EXPECT_FALSE(fs::exists(scratch() / "out/recording/mav0"));
}

TEST_F(CalibrateCommand, BoardsOfEitherKindArePrintedWithTheirDescription) {
  const fs::path pdf = scratch() / "board.pdf";
  fs::create_directories(scratch());
  const Outcome grid = run("board --out " + in_quotes(pdf));
  if (test::lacks_apriltag(grid.err)) GTEST_SKIP() << grid.err;
  ASSERT_EQ(grid.exit_code, 0) << grid.err;
  EXPECT_NE(grid.out.find("6 x 8 tags, 180.0 x 242.4 mm"), std::string::npos) << grid.out;
  EXPECT_NE(read(scratch() / "board.yaml").find("'aprilgrid'"), std::string::npos);
  const Outcome charuco = run("board --kind charuco --square-mm 30 --out " + in_quotes(pdf));
  EXPECT_NE(charuco.out.find("7 x 9 squares, 210.0 x 270.0 mm"), std::string::npos) << charuco.out;
  EXPECT_NE(charuco.out.find("correct squareSize"), std::string::npos) << charuco.out;
  EXPECT_NE(read(scratch() / "board.yaml").find("squareSize: 0.03"), std::string::npos);
  EXPECT_EQ(read(pdf).substr(0, 8), "%PDF-1.4");
  expect_one_line(run("board --kind charuco --spacing 0.3 --out " + in_quotes(pdf)), 2, {"--spacing"});
  expect_one_line(run("board --square-mm 30 --out " + in_quotes(pdf)), 2, {"--square-mm"});
  expect_one_line(run("board --kind charuco --tag-mm 25 --out " + in_quotes(pdf)), 2, {"nine tenths"});
}

TEST_F(CalibrateCommand, SetsWhatItFoundInTheConfiguration) {
  const fs::path recording = test::recorded_data("imu_april_tracks");
  if (!fs::exists(recording)) GTEST_SKIP() << "no recording " << recording;
  const fs::path config = scratch() / "flight.toml";
  const Outcome r =
      run("calibrate " + in_quotes(recording) + " --duration 5.5 --hold-lens --out " + in_quotes(scratch() / "found") +
          with_config("# mine\n[camera]\n#calibration = \"calibration/camera.yaml\"\ntime_offset_s = 0.03\n"));
  ASSERT_EQ(r.exit_code, 0) << r.err;
  EXPECT_NE(r.out.find("set in " + config.string()), std::string::npos) << r.out;
  const std::string text = read(config);
  EXPECT_NE(text.find("# mine"), std::string::npos);
  EXPECT_NE(text.find("found/camera.yaml\""), std::string::npos) << text;
  EXPECT_NE(text.find("found/imu.yaml\""), std::string::npos) << text;
  EXPECT_NE(text.find("# time_offset_s = 0.03"), std::string::npos) << "the calibration's would not count\n" << text;
  EXPECT_EQ(run("config --check " + in_quotes(config)).exit_code, 0);
  EXPECT_TRUE(fs::exists(scratch() / "found/camera.yaml") && fs::exists(scratch() / "flight.toml.bak"));
}

}  // namespace
}  // namespace epiline
