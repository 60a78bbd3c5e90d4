// `epiline hil` as a user meets it, over a rendered flight and a pty.
#include <unistd.h>

#include "tests/drivers/program.h"

namespace epiline {
namespace {

class HilCommand : public testing::Test {
 protected:
  /// One flight for all tests of the process; several processes may run at once.
  static void SetUpTestSuite() {
    flight_ = fs::path(testing::TempDir()) / ("epiline_hil_flight_" + std::to_string(getpid()));
    fs::remove_all(flight_);
    const std::string command = std::string(EPILINE_PROGRAM) + " simulate --flight agile --duration 5 --out '" +
                                flight_.string() + "' >/dev/null 2>&1";
    ASSERT_EQ(std::system(command.c_str()), 0);
  }
  static void TearDownTestSuite() { fs::remove_all(flight_); }
  void SetUp() override {
    fs::remove_all(scratch());
    write(config(), "[camera]\ncalibration = \"" + (flight_ / "mav0/cam0/sensor.yaml").string() +
                        "\"\n[imu]\ncalibration = \"" + (flight_ / "mav0/imu0/sensor.yaml").string() +
                        "\"\nrate_hz = 200\n");
  }
  void TearDown() override { fs::remove_all(scratch()); }

  static fs::path config() { return scratch() / "flight.toml"; }
  static Outcome hil(const std::string& more) {
    return run("hil '" + flight_.string() + "' --config '" + config().string() + "' --out '" +
               (scratch() / "out").string() + "' " + more);
  }
  /// Rules that a computer without time for us does not break.
  static void expect_sound(const std::string& verdict) {
    for (const char* rule : {"frames", "estimator type", "finite", "covariance", "quality", "silence when lost",
                             "stamps rise", "address", "sequence", "innovation"})
      EXPECT_NE(verdict.find(std::string(" ") + rule), std::string::npos) << rule;
    for (const char* broken :
         {"BROKEN    PX4        frames", "BROKEN    both       finite", "BROKEN    both       covariance",
          "BROKEN    both       stamps", "BROKEN    both       sequence", "BROKEN    PX4        innovation"})
      EXPECT_EQ(verdict.find(broken), std::string::npos) << verdict;
  }

  static fs::path flight_;
};
fs::path HilCommand::flight_;

TEST_F(HilCommand, AFlightIsAccepted) {
  Outcome r;
  for (int i = 0; i < 3; ++i) {  // a computer that had no time for us for a while gets another chance
    r = hil("");
    if (r.exit_code == 0) break;
  }
  ASSERT_EQ(r.exit_code, 0) << r.out << r.err;
  expect_sound(r.out);
  EXPECT_NE(r.out.find("PX4 accepts the odometry\nArduPilot accepts the odometry\n"), std::string::npos) << r.out;
  EXPECT_NE(r.out.find("latency   image stamp to last byte"), std::string::npos) << r.out;
  EXPECT_EQ(r.out.compare(0, read(scratch() / "out/verdict.txt").size(), read(scratch() / "out/verdict.txt")), 0);
  const Json s = Json::parse(read(scratch() / "out/stats.json"));
  EXPECT_LT(s["error"]["ate_4dof_m"]["rmse"].get<double>(), 0.05);
  EXPECT_GT(s["error"]["poses"].get<int>(), 40);
  EXPECT_TRUE(fs::exists(scratch() / "out/report.html"));
  EXPECT_TRUE(fs::exists(scratch() / "out/trajectory.tum"));
}

TEST_F(HilCommand, TheControllersOwnImuFliesToo) {
  Outcome r;
  for (int i = 0; i < 3; ++i) {
    r = hil("--imu mavlink --controller udp");
    if (r.exit_code == 0) break;
  }
  ASSERT_EQ(r.exit_code, 0) << r.out << r.err;
  expect_sound(r.out);
  EXPECT_LT(Json::parse(read(scratch() / "out/stats.json"))["error"]["ate_4dof_m"]["rmse"].get<double>(), 0.05);
}

// Too short for a first pose: a controller gets nothing to fuse.
TEST_F(HilCommand, AFlightThatIsRefusedFails) {
  const Outcome r = hil("--duration 0.2");
  expect_one_line(r, 1, {"rules are broken", "fusion"});
  EXPECT_NE(r.out.find("PX4 REFUSES"), std::string::npos) << r.out;
  EXPECT_NE(r.out.find("rule: odometry comes"), std::string::npos) << r.out;
}

TEST_F(HilCommand, LossesComeThrough) {
  const Outcome r = hil("--loss 0.3 --jitter-ms 5 --burst --skew-ppm 100");
  const Json s = Json::parse(read(scratch() / "out/stats.json"));
  const int in = s["realtime"]["frames_in"].get<int>();
  EXPECT_GT(in, 30) << r.out << r.err;
  EXPECT_LT(in, 90) << "of 101";
}

TEST_F(HilCommand, SaysWhatIsWrong) {
  expect_one_line(run("hil nowhere --config '" + config().string() + "'"), 2, {"nowhere"});
  expect_one_line(hil("--camera vivid"), 2, {"camera vivid"});
  expect_one_line(hil("--camera v4l2loopback:/dev/there_is_none"), 2, {"/dev/there_is_none", "modprobe v4l2loopback"});
  expect_one_line(hil("--controller /dev/there_is_none"), 2, {"/dev/there_is_none"});
  expect_one_line(hil("--controller nocan7"), 2, {"nocan7", "ip link add"});
  expect_one_line(hil("--start 100"), 2, {"no image in the time asked for"});
  write(config(), "[camera]\n");
  expect_one_line(hil(""), 2, {"no camera.calibration"});
}

}  // namespace
}  // namespace epiline
