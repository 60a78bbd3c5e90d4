// `epiline check` as a user meets it, on a computer without the devices.
#include "tests/drivers/program/program.h"

namespace epiline {
namespace {

class CheckCommand : public CommandTest {};

TEST_F(CheckCommand, WithoutDevicesNamesWhatIsMissing) {
  const std::string file = with_config(
      "[camera]\ndevice = \"/dev/no-such-camera\"\n[imu]\ndevice = \"no-such-imu\"\n[mavlink]\nserial = "
      "\"/dev/no-such-line\"\n[can]\ninterface = \"nocan9\"\n");
  const Outcome r = run("check " + file);
  EXPECT_EQ(r.exit_code, 1);
  for (const char* part :
       {"error    camera: /dev/no-such-camera does not exist; ", "error    imu: no device is called \"no-such-imu\"; ",
        "error    mavlink: /dev/no-such-line does not exist; ", "error    can: no CAN interface nocan9; ",
        "\npresent  cameras: "})
    EXPECT_NE(r.out.find(part), std::string::npos) << part << " not in\n" << r.out;
  EXPECT_EQ(r.err, "");
  const Outcome json = run("check --json " + file);
  EXPECT_EQ(json.exit_code, 1);
  const Json all = Json::parse(json.out);
  EXPECT_EQ(all["findings"][0]["grade"], "error");
  EXPECT_EQ(all["findings"][0]["device"], "camera");
  EXPECT_TRUE(all["present"]["cameras"].is_array());
}

TEST_F(CheckCommand, WithoutACalibrationOnlyWhatNeedsOneIsMissing) {
  const Outcome r = run("check " + with_config("[camera]\ndevice = \"/dev/no-such-camera\"\n"));
  EXPECT_EQ(r.exit_code, 1);
  EXPECT_NE(r.out.find("camera.calibration is not set: lens, time offset and rotation not checked; calibrate: "),
            std::string::npos)
      << r.out;
  EXPECT_NE(r.out.find("/dev/no-such-camera does not exist"), std::string::npos) << r.out;
}

TEST_F(CheckCommand, ItsPageIsServedMeanwhile) {
  const std::string file = with_config("[camera]\ndevice = \"/dev/no-such-camera\"\n");
  expect_one_line(run("check --json --view 0 " + file), 2, {"--json with --view"});
#ifdef EPILINE_MICROHTTPD
  const Outcome r = run("check --view 0 --seconds 1 " + file);
  EXPECT_EQ(r.exit_code, 1);
  EXPECT_NE(r.out.find("view      http://127.0.0.1:"), std::string::npos) << r.out;
  EXPECT_NE(r.out.find("/dev/no-such-camera does not exist"), std::string::npos) << r.out;
#endif
}

TEST_F(CheckCommand, AWrongFileIsWrongInput) {
  expect_one_line(run("check " + with_config("[camera]\ndevice = 3\n")), 2, {"flight.toml:2: camera.device = 3"});
  EXPECT_EQ(run("check --config /no/such/file.toml").exit_code, 2);
}

TEST_F(CheckCommand, AnErrorIsAnObjectOfJsonToo) {
  const std::string wrong_file = with_config("[camera]\ndevice = 3\n");
  for (const std::string& arguments : {"check --json " + wrong_file, "check --json --sideways " + wrong_file,
                                       std::string("evaluate --json /no/such/a.tum /no/such/b.tum")}) {
    const Outcome r = run(arguments);
    expect_one_line(r, 2, {});
    const Json all = Json::parse(r.out, nullptr, false);
    ASSERT_TRUE(all.is_object()) << arguments << ": " << r.out;
    EXPECT_EQ(all["schema"], 1);
    EXPECT_EQ(all["error"]["kind"], "usage");
    EXPECT_FALSE(all["error"]["found"].get<std::string>().empty());
    EXPECT_FALSE(all["error"]["expected"].get<std::string>().empty());
  }
  EXPECT_EQ(Json::parse(run("check --json " + wrong_file).out)["error"]["line"], 2);
  EXPECT_EQ(run("check " + wrong_file).out, "") << "only when asked for";
}

}  // namespace
}  // namespace epiline
