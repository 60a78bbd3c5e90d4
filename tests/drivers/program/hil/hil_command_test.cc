// `epiline hil` as a user meets it, over a rendered flight and a pty.
#include <gmock/gmock.h>

#include <sstream>

#include <cstdio>

#include "tests/drivers/program/program.h"

namespace epiline {
namespace {

using testing::ElementsAre;

class HilCommand : public OverARenderedFlight {
 protected:
  void SetUp() override {
    OverARenderedFlight::SetUp();
    write(config(), calibrated_by(flight_) + "rate_hz = 200\n");
  }

  static fs::path config() { return scratch() / "flight.toml"; }
  static Outcome hil(const std::string& more, const fs::path& flight = flight_) {
    return run("hil '" + flight.string() + "' --config '" + config().string() + "' --out '" +
               (scratch() / "out").string() + "' " + more);
  }
  /// A flight lasts as long as it lasted: a computer that had no time for us for a while gets other chances.
  template <class IsGood>
  static Outcome hil_until(const IsGood& is_good, const std::string& more, const fs::path& flight = flight_) {
    Outcome r;
    for (int i = 0; i < 10; ++i) {
      r = hil(more, flight);
      if (is_good(r)) break;
    }
    return r;
  }
  static bool accepts(const Outcome& r) { return r.exit_code == 0; }
  /// The rules that had no occasion, of a summary.
  static auto no_occasion() {
    return ElementsAre("timesync converges", "turn 33 degrees", "turn 15 degrees", "turn 34 degrees", "origin",
                       "CAN frames", "CAN status");
  }
  static std::vector<std::string> not_seen(const std::string& summary) {
    const std::string begin = "not seen  ";
    const std::size_t name = begin.size() + std::string("ArduPilot  ").size();
    std::vector<std::string> rules;
    std::istringstream lines(summary);
    for (std::string line; std::getline(lines, line);)
      if (line.rfind(begin, 0) == 0) rules.push_back(line.substr(name, line.find(':') - name));
    return rules;
  }
};

TEST_F(HilCommand, AFlightIsAccepted) {
  const Outcome r = hil_until(accepts, "");
  ASSERT_EQ(r.exit_code, 0) << r.out << r.err;
  EXPECT_THAT(not_seen(r.out), no_occasion());
  EXPECT_NE(r.out.find("PX4 1.14 accepts the odometry\nPX4 1.15 accepts the odometry\nPX4 1.16 accepts the odometry\n"
                       "PX4 1.17 accepts the odometry\nPX4 1.18 accepts the odometry\nPX4 main accepts the "
                       "odometry\nArduPilot 4.5 accepts the odometry\n"),
            std::string::npos)
      << r.out;
  EXPECT_NE(r.out.find("latency   image timestamp to last byte"), std::string::npos) << r.out;
  EXPECT_EQ(r.out.compare(0, read(scratch() / "out/verdict.txt").size(), read(scratch() / "out/verdict.txt")), 0);
  const Json s = stats("out");
  EXPECT_LT(s["error"]["ate_4dof_m"]["rmse"].get<double>(), 0.05);
  EXPECT_GT(s["error"]["poses"].get<int>(), 40);
  EXPECT_TRUE(fs::exists(scratch() / "out/report.html"));
  EXPECT_TRUE(fs::exists(scratch() / "out/trajectory.tum"));
  // What the controller got, laid over the truth at its times.
  const Outcome evaluated = run("evaluate '" + (scratch() / "out/received.tum").string() + "' '" +
                                (scratch() / "out/truth.tum").string() + "' --json");
  ASSERT_EQ(evaluated.exit_code, 0) << evaluated.err;
  const Json received = Json::parse(evaluated.out);
  EXPECT_LT(received["ate_m"]["rmse"].get<double>(), 0.05);
  EXPECT_GT(received["poses"].get<int>(), 60);
  char line[64];
  std::snprintf(line, sizeof line, " poses, %.4f m rms off over", received["ate_m"]["rmse"].get<double>());
  EXPECT_NE(r.out.find(line), std::string::npos) << r.out;
}

TEST_F(HilCommand, TwoCamerasFly) {
  const fs::path flight = scratch() / "two";
  ASSERT_EQ(run("simulate --flight agile --duration 4 --baseline 0.11 --out '" + flight.string() + "'").exit_code, 0);
  const std::string sensors = (flight / "mav0").string();
  write(config(), "[camera]\nside_by_side = \"left-first\"\ncalibration = \"" + sensors +
                      "/cam0/sensor.yaml\"\n[second_camera]\ncalibration = \"" + sensors +
                      "/cam1/sensor.yaml\"\n[imu]\ncalibration = \"" + sensors +
                      "/imu0/sensor.yaml\"\nrate_hz = 200\n");
  const Outcome r = hil_until(accepts, "", flight);
  ASSERT_EQ(r.exit_code, 0) << r.out << r.err;
  const Json s = stats("out");
  EXPECT_LT(s["error"]["ate_4dof_m"]["rmse"].get<double>(), 0.05) << r.out << r.err;
  const Json& second = s["tracks"]["other_cameras"][0];
  EXPECT_GT(second["images"].get<int>(), 40);
  EXPECT_GT(second["share_of_tracks"].get<double>(), 0.3);
}

TEST_F(HilCommand, TheControllersOwnImuFliesToo) {
  const Outcome r = hil_until(accepts, "--imu mavlink --controller udp");
  ASSERT_EQ(r.exit_code, 0) << r.out << r.err;
  EXPECT_THAT(not_seen(r.out), no_occasion());
  EXPECT_LT(stats("out")["error"]["ate_4dof_m"]["rmse"].get<double>(), 0.05);
}

// The recording of an IMU whose gyroscope is turned by a quarter, and whose accelerometer's y axis leans towards x
// by 3.6 degrees. The run corrects the readings, once: whether they never were or were twice, it would not start.
TEST_F(HilCommand, ReadingsAreCorrectedOnce) {
  const fs::path flight = scratch() / "leaning", imu = flight / "mav0/imu0";
  fs::copy(flight_, flight, fs::copy_options::recursive);
  std::istringstream readings(read(imu / "data.csv"));
  std::string leaning;
  for (std::string line; std::getline(readings, line);) {
    double w[3], a[3];
    long long stamp_ns = 0;
    if (std::sscanf(line.c_str(), "%lld,%lf,%lf,%lf,%lf,%lf,%lf", &stamp_ns, w, w + 1, w + 2, a, a + 1, a + 2) != 7)
      continue;
    char text[200];
    std::snprintf(text, sizeof text, "%lld,%.9f,%.9f,%.9f,%.9f,%.9f,%.9f\n", stamp_ns, w[1], -w[0], w[2], a[0],
                  a[1] + 0.0625 * a[0], a[2]);
    leaning += text;
  }
  write(imu / "data.csv", leaning);
  write(scratch() / "imu.yaml", read(imu / "sensor.yaml") +
                                    "accelerometers:\n  M: [1, 0, 0, 0.0625, 1, 0, 0, 0, 1]\n"
                                    "gyroscopes:\n  C_gyro_i: [0, 1, 0, -1, 0, 0, 0, 0, 1]\n");
  write(config(), calibrated_by(flight_, scratch() / "imu.yaml") + "rate_hz = 200\n");
  for (const char* const way : {"", "--imu mavlink"}) {
    const Outcome r = hil_until(accepts, way, flight);
    ASSERT_EQ(r.exit_code, 0) << way << r.out << r.err;
    EXPECT_LT(stats("out")["error"]["ate_4dof_m"]["rmse"].get<double>(), 0.05) << way;
  }
}

// Who names a place meets an ArduPilot without satellites, which wants to know it.
TEST_F(HilCommand, AnArduPilotIsToldWhereItIs) {
  write(config(), read(config()) + "[mavlink]\norigin = [47.4, 8.5, 0]\n");
  const std::string kept = "\nkept      ArduPilot  origin\n";
  const Outcome r = hil_until([&](const Outcome& o) { return o.out.find(kept) != std::string::npos; }, "--duration 2");
  EXPECT_NE(r.out.find(kept), std::string::npos) << r.out << r.err;
}

// With a heading PX4 gets poses to the north, which ArduPilot ignores.
TEST_F(HilCommand, TheJudgesAreChosen) {
  write(config(), read(config()) + "[mavlink]\nframe = \"local-ned\"\nheading_deg = 200\n");
  const std::string accepted = "PX4 1.16 accepts the odometry";
  Outcome r = hil_until([&](const Outcome& o) { return o.out.find(accepted) != std::string::npos; }, "--duration 2");
  EXPECT_EQ(r.exit_code, 1);
  EXPECT_NE(r.out.find(accepted), std::string::npos) << r.out << r.err;
  EXPECT_NE(r.out.find("ArduPilot 4.6 REFUSES the odometry"), std::string::npos) << r.out;
  r = hil_until(accepts, "--judge px4,px4-spring-2026 --duration 2");
  EXPECT_EQ(r.exit_code, 0) << r.out << r.err;
  EXPECT_NE(r.out.find("PX4 main of 27 February to 18 May 2026 accepts the odometry"), std::string::npos) << r.out;
  EXPECT_EQ(r.out.find("ArduPilot 4"), std::string::npos) << r.out;
  EXPECT_NE(hil("--judge px4-1.13").err.find("judge px4-1.13; expected px4, ardupilot"), std::string::npos);
}

// Too short for a first pose: a controller gets nothing to fuse.
TEST_F(HilCommand, AFlightThatIsRefusedFails) {
  const Outcome r = hil("--duration 0.2");
  expect_one_line(r, 1, {"breaks", "rules of the flight controllers", "fusion"});
  EXPECT_NE(r.out.find("PX4 1.16 REFUSES"), std::string::npos) << r.out;
  EXPECT_NE(r.out.find("rule: odometry that arrives"), std::string::npos) << r.out;
}

TEST_F(HilCommand, LossesComeThrough) {
  int in = 0;
  const auto is_good = [&](const Outcome&) {
    in = stats("out")["realtime"]["frames_in"].get<int>();
    return in > 30;
  };
  const Outcome r = hil_until(is_good, "--loss 0.3 --jitter-ms 5 --burst --skew-ppm 100");
  EXPECT_GT(in, 30) << r.out << r.err;
  EXPECT_LT(in, 90) << "of 101";
}

TEST_F(HilCommand, SaysWhatIsWrong) {
  expect_one_line(run("hil nowhere --config '" + config().string() + "'"), 2, {"nowhere"});
  expect_one_line(hil("--camera vivid"), 2, {"camera vivid"});
  expect_one_line(hil("--camera v4l2loopback:/dev/there_is_none"), 2, {"/dev/there_is_none", "modprobe v4l2loopback"});
  expect_one_line(hil("--camera v4l2loopback:/dev/video42,/dev/video43"), 2,
                  {"1 of its cameras with 2 loopback devices", "a device for each"});
  expect_one_line(hil("--controller /dev/there_is_none"), 2, {"/dev/there_is_none"});
  expect_one_line(hil("--controller nocan7"), 2, {"nocan7", "ip link add"});
  expect_one_line(hil("--start 100"), 2, {"no image between --start and --duration"});
  expect_one_line(hil("--controller ''"), 2, {"no controller"});
  expect_one_line(hil("--controller udp:0"), 2, {"udp:PORT"});
  expect_one_line(hil("--controller pty:" + config().string()), 2, {"flight.toml", "an unused path"});
  write(config(), "[camera]\n");
  expect_one_line(hil(""), 2, {"camera.calibration is not set"});
}

// Another process opens what is played: it has to be where its configuration looks for it.
TEST_F(HilCommand, SaysWhatNobodyBesideWouldFind) {
  const std::string camera = "--beside --camera v4l2loopback:/dev/video42 ", imu = camera + "--imu uhid ";
  expect_one_line(hil("--beside"), 2, {"--beside with --camera: file"});
  expect_one_line(hil(camera), 2, {"--beside with --imu: file"});
  expect_one_line(hil(imu), 2, {"--beside with --controller: pty"});
  expect_one_line(hil(imu + "--controller pty:/run/controller"), 2, {"mavlink.serial = \"\"", "\"/run/controller\""});
  expect_one_line(hil(imu + "--controller vcan0"), 2, {"can.interface = \"\"", "\"vcan0\""});
  std::string text = read(config());
  text.insert(text.find('\n') + 1, "device = \"/dev/video7\"\n");
  write(config(), text);
  expect_one_line(hil(imu + "--controller vcan0"), 2, {"camera.device = \"/dev/video7\"", "\"/dev/video42\""});
  text.replace(text.find("video7"), 6, "video42");
  write(config(), text + "[second_camera]\ndevice = \"/dev/video8\"\ncalibration = \"" +
                      (flight_ / "mav0/cam0/sensor.yaml").string() + "\"\n");
  expect_one_line(hil(imu + "--controller vcan0"), 2, {"v4l2loopback:/dev/video42", "each of the 2"});
  expect_one_line(hil("--beside --camera v4l2loopback:/dev/video42,/dev/video43 --imu uhid --controller vcan0"), 2,
                  {"second_camera.device = \"/dev/video8\"", "\"/dev/video43\""});
}

}  // namespace
}  // namespace epiline
