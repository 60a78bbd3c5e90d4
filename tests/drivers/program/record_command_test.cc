// `epiline record` as a user meets it where something is missing. Whole recordings: record/record_test.cc.
#include <gtest/gtest.h>

#include <string>

#include "tests/drivers/program/program.h"

namespace epiline {
namespace {

class RecordCommand : public CommandTest {
 protected:
  static Outcome record_with(const std::string& config, const std::string& options = "") {
    return run("record" + with_config(config) + "--out " + in_quotes(scratch() / "out") + " " + options);
  }
};

TEST_F(RecordCommand, SaysWhatIsMissing) {
  const Outcome no_folder = run("record");
  EXPECT_EQ(no_folder.exit_code, 2);
  EXPECT_NE(no_folder.err.find("--out"), std::string::npos) << no_folder.err;
  expect_one_line(record_with(""), 2, {"flight.toml: camera.device is not set"});
  expect_one_line(record_with("[camera]\ndevice = \"/dev/video77\"\n"), 2, {"flight.toml: imu.device is not set"});
  expect_one_line(record_with("[camera]\ndevise = 1\n"), 2, {"flight.toml:2: ", "camera.devise"});
}

TEST_F(RecordCommand, SaysWhichDeviceIsNotThereAndLeavesNothing) {
  const Outcome r = record_with(kAbsentDevices);
  expect_one_line(r, 1, {"iio:device77"});
  EXPECT_EQ(r.out, "");
  EXPECT_FALSE(fs::exists(scratch() / "out/mav0")) << "a second attempt would be refused";
}

TEST_F(RecordCommand, KeepsWhatWasRecordedBefore) {
  write(scratch() / "out/mav0/cam0/data.csv", "#\n");
  expect_one_line(record_with(kAbsentDevices), 2, {"out/mav0: exists already"});
  EXPECT_EQ(read(scratch() / "out/mav0/cam0/data.csv"), "#\n");
}

TEST_F(RecordCommand, DoesNotBeginWithoutRoom) {
  expect_one_line(record_with(kAbsentDevices, "--keep-free 1e12"), 2, {"MB are free", "--keep-free"});
}

TEST_F(RecordCommand, ErrorsAreJsonToo) {
  const Outcome r = record_with(kAbsentDevices, "--json");
  EXPECT_EQ(r.exit_code, 1);
  EXPECT_EQ(Json::parse(r.out)["error"]["kind"], "run");
}

}  // namespace
}  // namespace epiline
