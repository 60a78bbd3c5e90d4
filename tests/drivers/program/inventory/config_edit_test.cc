// Settings written into a user's configuration. What is read from it afterwards is the judge.
#include "drivers/program/inventory/config_edit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <string>

#include "pipeline/config/config.h"
#include "pipeline/text/table.h"

namespace epiline {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

const std::vector<ConfigEdit> kEdits = {{"camera", "calibration", "/cal/camera.yaml"},
                                        {"imu", "calibration", "/cal/i \"m\" u.yaml"}};

Config read(const std::string& text) {
  Config config;
  const auto file = ConfigFile::parse(text, "test.toml");
  EXPECT_TRUE(file) << file.error().text() << text;
  if (file) file->apply(config);
  return config;
}

void expect_set(const std::string& text) {
  const std::string edited = edited_config(text, kEdits);
  const Config config = read(edited);
  EXPECT_EQ(config.camera_calibration, "/cal/camera.yaml") << edited;
  EXPECT_EQ(config.imu_calibration, "/cal/i \"m\" u.yaml") << edited;
  EXPECT_EQ(edited_config(edited, kEdits), edited) << "again changes nothing";
}

TEST(ConfigEdit, SetsWhatIsSetCommentedOrNotThere) {
  expect_set("");
  expect_set("[camera]\ncalibration = \"old.yaml\"\n[imu]\nrate_hz = 100\n");
  expect_set("[imu]  # of the controller\n#calibration = \"x\"\n\n[camera]\nwidth = 640\nheight = 480");
  expect_set("[camera]\r\nwidth = 640\r\nheight = 480\r\n");
  expect_set("# calibration = \"before any section\"\n[tracker]\nmax_features = 100\n");
}

TEST(ConfigEdit, KeepsEverythingElse) {
  const std::string text =
      "# mine\n[camera]\n# calibration = \"shown\"\ncalibration = 'old.yaml'\nwidth = 640 # wide\n\n[imu]\n"
      "# about calibration = nothing\n";
  EXPECT_EQ(edited_config(text, {{"camera", "calibration", "new.yaml"}}),
            "# mine\n[camera]\n# calibration = \"shown\"\ncalibration = \"new.yaml\"\nwidth = 640 # wide\n\n[imu]\n"
            "# about calibration = nothing\n");
  EXPECT_EQ(edited_config("[imu]\ndevice_accel = \"a\"\n", {{"imu", "device", "d"}}),
            "[imu]\ndevice = \"d\"\ndevice_accel = \"a\"\n");
}

TEST(ConfigEdit, ANumberIsWrittenAsOne) {
  for (const char* value : {"0.0251", "-0.004", "1.8e-05", "0"}) {
    const Config config =
        read(edited_config("[camera]\n# time_offset_s = 0\n", {{"camera", "time_offset_s", value, EditKind::kNumber}}));
    EXPECT_EQ(config.estimator.extrinsics.time_offset_s, std::stod(value));
  }
}

TEST(ConfigEdit, WhatIsUnsetBecomesAComment) {
  const std::vector<ConfigEdit> unset = {{"camera", "time_offset_s", "", EditKind::kUnset}};
  const std::string text = "[imu]\ntime_offset_s = 1\n[camera]\n#time_offset_s = 0\n  time_offset_s = 0.02 # found\n";
  const std::string edited = edited_config(text, unset);
  EXPECT_EQ(edited, "[imu]\ntime_offset_s = 1\n[camera]\n#time_offset_s = 0\n#   time_offset_s = 0.02 # found\n");
  EXPECT_EQ(edited_config(edited, unset), edited) << "nothing is set any more";
  EXPECT_EQ(edited_config("[imu]\n", unset), "[imu]\n");
}

class ConfigEditFile : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) / ("epiline_config_edit_" + std::to_string(getpid()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  fs::path file() const { return folder_ / "flight.toml"; }
  fs::path folder_;
};

TEST_F(ConfigEditFile, IsKeptAsItWasBesideTheNewOne) {
  ASSERT_TRUE(write_text(file(), "[camera]\nwidth = 640\nheight = 480\n"));
  ASSERT_TRUE(edit_config(file(), kEdits));
  EXPECT_EQ(*read_text(folder_ / "flight.toml.bak"), "[camera]\nwidth = 640\nheight = 480\n");
  EXPECT_EQ(read(*read_text(file())).camera_calibration, "/cal/camera.yaml");
  const auto again = edit_config(file(), kEdits);  // what was kept is not lost
  ASSERT_TRUE(again);
  EXPECT_EQ(*again, folder_ / "flight.toml.bak.1");
  EXPECT_EQ(*read_text(folder_ / "flight.toml.bak"), "[camera]\nwidth = 640\nheight = 480\n");
}

TEST_F(ConfigEditFile, ThatIsBrokenIsLeftAlone) {
  const auto missing = edit_config(file(), kEdits);
  ASSERT_FALSE(missing);
  EXPECT_THAT(missing.error().text(), HasSubstr("flight.toml"));
  for (const char* text : {"[camera\n", "[camera]\nwidth = \"wide\"\n"}) {
    ASSERT_TRUE(write_text(file(), text));
    EXPECT_FALSE(edit_config(file(), kEdits));
    EXPECT_EQ(*read_text(file()), text);
    EXPECT_FALSE(fs::exists(folder_ / "flight.toml.bak"));
  }
  // dotted keys are not searched for: what would then be there twice is refused
  ASSERT_TRUE(write_text(file(), "camera.calibration = \"a\"\n"));
  const auto twice = edit_config(file(), kEdits);
  EXPECT_FALSE(twice);
  EXPECT_EQ(*read_text(file()), "camera.calibration = \"a\"\n");
}

}  // namespace
}  // namespace epiline
