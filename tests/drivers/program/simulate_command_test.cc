// `epiline-study simulate` as a user meets it: the folder it leaves, its errors, and what a replay makes of it.
#include <sstream>

#include "drivers/flights/recordings/asl_dataset.h"
#include "pipeline/config/calibration.h"
#include "tests/drivers/program/program.h"

namespace epiline {
namespace {

class SimulateCommand : public CommandTest {
 protected:
  std::string in(const std::string& name) const { return (scratch() / name).string(); }
  std::vector<fs::path> images(const std::string& name) const {
    std::vector<fs::path> list;
    for (const auto& entry : fs::directory_iterator(scratch() / name / "mav0/cam0/data"))
      list.push_back(entry.path().filename());
    std::sort(list.begin(), list.end());
    return list;
  }
};

TEST_F(SimulateCommand, RendersAFlightThatAReplayTracks) {
  ASSERT_EQ(run("simulate --flight agile --duration 5 --out " + in("flight")).exit_code, 0);
  EXPECT_EQ(images("flight").size(), 101U);
  EXPECT_FALSE(fs::exists(scratch() / "flight/mav0.partial"));
  const Outcome replayed = run("replay " + in("flight") + " --out " + in("results"));
  ASSERT_EQ(replayed.exit_code, 0) << replayed.err;
  EXPECT_NE(replayed.out.find("coverage 100.0 %"), std::string::npos) << replayed.out;
}

TEST_F(SimulateCommand, RefusesWhatSimulatedTracksDoNotFollow) {
  for (const std::string& option :
       std::vector<std::string>{"--rate 40", "--world hall", "--effects noise", "--camera x.yaml"}) {
    const Outcome refused = run("simulate --tracks --duration 1 " + option + " --out " + in("t"));
    EXPECT_EQ(refused.exit_code, 2) << option;
    EXPECT_NE(refused.err.find(option.substr(0, option.find(' '))), std::string::npos) << refused.err;
  }
}

// The same seed gives the same bytes, whatever the number of threads; another seed does not.
TEST_F(SimulateCommand, IsReproducible) {
  const std::string flight = "simulate --flight corridor --duration 0.4 --effects blur,noise,moving ";
  ASSERT_EQ(run(flight + "--jobs 1 --out " + in("a")).exit_code, 0);
  ASSERT_EQ(run(flight + "--jobs 3 --out " + in("b")).exit_code, 0);
  ASSERT_EQ(run(flight + "--seed 2 --out " + in("c")).exit_code, 0);
  const auto names = images("a");
  ASSERT_EQ(names, images("b"));
  ASSERT_EQ(names.size(), 9U);
  for (const fs::path& name : names) {
    EXPECT_EQ(read(scratch() / "a/mav0/cam0/data" / name), read(scratch() / "b/mav0/cam0/data" / name));
    EXPECT_NE(read(scratch() / "a/mav0/cam0/data" / name), read(scratch() / "c/mav0/cam0/data" / name));
  }
  EXPECT_EQ(read(scratch() / "a/mav0/imu0/data.csv"), read(scratch() / "b/mav0/imu0/data.csv"));
}

// A second camera leaves the bytes of the first one as they are, and has an image for each of its images.
TEST_F(SimulateCommand, RendersASecondCameraBesideTheFirst) {
  const std::string flight = "simulate --flight hall --duration 0.3 --effects noise,blur,drops=0.3 ";
  ASSERT_EQ(run(flight + "--out " + in("one")).exit_code, 0);
  ASSERT_EQ(run(flight + "--baseline 0.11 --out " + in("two")).exit_code, 0);
  const auto names = images("one");
  ASSERT_EQ(names, images("two"));
  ASSERT_GE(names.size(), 2U);
  for (const fs::path& name : names) {
    const std::string first = read(scratch() / "two/mav0/cam0/data" / name);
    EXPECT_EQ(first, read(scratch() / "one/mav0/cam0/data" / name));
    EXPECT_NE(first, read(scratch() / "two/mav0/cam1/data" / name));
  }
  EXPECT_EQ(read(scratch() / "two/mav0/cam0/data.csv"), read(scratch() / "two/mav0/cam1/data.csv"));
  EXPECT_FALSE(fs::exists(scratch() / "one/mav0/cam1"));
  const auto first = read_camera_calibration(scratch() / "two/mav0/cam0/sensor.yaml", "cam0");
  const auto second = read_camera_calibration(scratch() / "two/mav0/cam1/sensor.yaml", "cam1");
  ASSERT_TRUE(first && second);
  EXPECT_LT((first->R_BC.transpose() * (second->p_BC - first->p_BC) - Vec3(0.11, 0, 0)).norm(), 1e-12);
}

// Two calibrations give a rig; a built-in flight turns it as a whole.
TEST_F(SimulateCommand, KeepsTheRigOfTwoCalibrations) {
  ASSERT_EQ(run("simulate --flight hall --duration 0.1 --baseline 0.2 --out " + in("a")).exit_code, 0);
  const std::string a = in("a/mav0/"),
                    rig = " --camera " + a + "cam0/sensor.yaml --other-camera " + a + "cam1/sensor.yaml";
  ASSERT_EQ(run("simulate --flight survey --duration 0.1" + rig + " --out " + in("b")).exit_code, 0);
  const auto first = read_camera_calibration(scratch() / "b/mav0/cam0/sensor.yaml", "cam0");
  const auto second = read_camera_calibration(scratch() / "b/mav0/cam1/sensor.yaml", "cam1");
  ASSERT_TRUE(first && second);
  EXPECT_LT((first->R_BC.transpose() * (second->p_BC - first->p_BC) - Vec3(0.2, 0, 0)).norm(), 1e-12);
  EXPECT_LT((first->R_BC - second->R_BC).norm(), 1e-12);
  expect_one_line(run("simulate --flight hall --other-camera " + a + "cam1/sensor.yaml --out " + in("x")), 2,
                  {"--camera"});
  expect_one_line(run("simulate --flight hall --later 0.01 --out " + in("x")), 2, {"--baseline"});
  EXPECT_FALSE(fs::exists(scratch() / "x"));
}

// Each --other-camera is the next one of the rig.
TEST_F(SimulateCommand, RendersUpToFourCameras) {
  ASSERT_EQ(run("simulate --flight hall --duration 0.1 --baseline 0.2 --out " + in("pair")).exit_code, 0);
  const std::string sensors = in("pair/mav0/"), other = " --other-camera " + sensors + "cam1/sensor.yaml";
  const std::string one = "simulate --flight hall --duration 0.3 --camera " + sensors + "cam0/sensor.yaml" + other;
  ASSERT_EQ(run(one + other + other + " --out " + in("four")).exit_code, 0);
  const Outcome flown = run("replay " + in("four") + " --camera all --out " + in("flown"));
  EXPECT_NE(flown.out.find("cam3"), std::string::npos) << flown.out;
  const Json others = Json::parse(read(scratch() / "flown/stats.json"))["tracks"]["other_cameras"];
  ASSERT_EQ(others.size(), 3U);
  EXPECT_EQ(others[2]["camera"], 3);
  EXPECT_GT(others[2]["tracks_of_its_own"], 0);
  EXPECT_EQ(run(one + other + other + other + " --out " + in("five")).exit_code, 2);
  EXPECT_FALSE(fs::exists(scratch() / "five"));
}

// Rolling shutters, of which the second one takes its images later.
TEST_F(SimulateCommand, CamerasNeedNoTrigger) {
  ASSERT_EQ(run("simulate --flight hall --duration 0.1 --baseline 0.1 --later 0.012 --effects rolling-shutter=30 "
                "--out " +
                in("free"))
                .exit_code,
            0);
  const auto second = read_camera_calibration(scratch() / "free/mav0/cam1/sensor.yaml", "cam1");
  ASSERT_TRUE(second);
  EXPECT_NEAR(second->parameters.readout_s, 30e-6 * (second->parameters.height - 1), 1e-9);
  const auto dataset = open_asl_dataset(scratch() / "free", "cam0"),
             other = open_asl_dataset(scratch() / "free", "cam1");
  ASSERT_TRUE(dataset && other);
  EXPECT_NEAR((other->images[1].stamp - dataset->images[1].stamp).seconds(), 0.012, 1e-9);
}

// Two cameras, of which the second one misses an image; in one thread and in several.
TEST_F(SimulateCommand, AReplayUsesBothCameras) {
  ASSERT_EQ(run("simulate --flight agile --duration 3 --baseline 0.11 --out " + in("pair")).exit_code, 0);
  const fs::path list = scratch() / "pair/mav0/cam1/data.csv";
  std::string rows = read(list);
  rows.erase(rows.rfind('\n', rows.size() - 2) + 1);
  write(list, rows);
  const std::string pair = "replay " + in("pair");
  ASSERT_EQ(run(pair + " --out " + in("one")).exit_code, 0);
  EXPECT_TRUE(Json::parse(read(scratch() / "one/stats.json"))["tracks"]["other_cameras"].empty());
  for (const std::string more : {"", " --realtime --speed 0.5"}) {
    const Outcome both = run(pair + " --camera both --out " + in("both") + more);
    ASSERT_EQ(both.exit_code, 0) << both.err;
    EXPECT_NE(both.out.find("% of another camera's tracks seen, "), std::string::npos) << both.out;
    const Json stats = Json::parse(read(scratch() / "both/stats.json")), second = stats["tracks"]["other_cameras"][0];
    EXPECT_EQ(second["images"].get<int>() + 1, stats["images"]["tracked"].get<int>());
    EXPECT_EQ(second["images_missing"], 1);
    EXPECT_GT(second["share_of_tracks"].get<double>(), 0.5) << second;
  }
  // each tracker keeps an image of its own while the first camera is covered
  write(scratch() / "patient.toml", kPatient);
  const std::string covered = pair + " --camera both --fault camera-black@1.6:0.8 --config " + in("patient.toml");
  ASSERT_EQ(run(covered + " --out " + in("covered")).exit_code, 0);
  Json threads;
  for (const std::string speed : {"1", "0.3", "0.1"}) {  // a computer that had no time for us gets another chance
    fs::remove_all(scratch() / "records");
    ASSERT_EQ(run(covered + " --realtime --speed " + speed + " --record " + in("records") + " --record-images --out " +
                  in("threads"))
                  .exit_code,
              0);
    threads = Json::parse(read(scratch() / "threads/stats.json"));
    if (threads["images"]["skipped"] == 0 && threads["realtime"]["images_not_logged"] == 0) break;
  }
  EXPECT_EQ(read(scratch() / "threads/trajectory.tum"), read(scratch() / "covered/trajectory.tum"));
  // and so does the flight recorder's record
  const std::string record = threads["realtime"]["recorder"]["written"].back();
  ASSERT_EQ(
      run("replay '" + record + "' --camera both --config '" + record + "/config.toml' --out " + in("again")).exit_code,
      0);
  EXPECT_EQ(read(scratch() / "again/trajectory.tum"), read(scratch() / "covered/trajectory.tum"));
  fs::remove(list);
  expect_one_line(run(pair + " --camera both --out " + in("both")), 2, {"cam1"});
}

TEST_F(SimulateCommand, DropsImages) {
  ASSERT_EQ(run("simulate --flight still --duration 3 --effects drops=0.5 --out " + in("a")).exit_code, 0);
  EXPECT_GT(images("a").size(), 15U);
  EXPECT_LT(images("a").size(), 46U);
}

TEST_F(SimulateCommand, SaysWhatIsWrongInOneLine) {
  const std::vector<std::string> wrong = {
      "simulate --world moon --out " + in("x"),    "simulate --flight nowhere --out " + in("x"),
      "simulate --effects fog --out " + in("x"),   "simulate --camera " + in("missing.yaml") + " --out " + in("x"),
      "simulate --pixel-noise 1 --out " + in("x"), "simulate --flight hall"};
  for (const std::string& arguments : wrong) {
    expect_one_line(run(arguments), 2, {});
    EXPECT_FALSE(fs::exists(scratch() / "x")) << arguments;
  }
}

/// A recorded flight, in effect: 12 s of IMU and truth, and a camera's calibration.
class SimulateFromRecording : public SimulateCommand {
 protected:
  void SetUp() override {
    SimulateCommand::SetUp();
    ASSERT_EQ(run("simulate --tracks --flight agile --out " + in("recorded")).exit_code, 0);
  }
  std::string render(const std::string& more = "") {
    return "simulate --from " + in("recorded") + " --duration 3 --out " + in("x") + more;
  }
  fs::path truth() const { return scratch() / "recorded/mav0/state_groundtruth_estimate0/data.csv"; }
};

// The recorded readings are handed on as they are; the images follow the recorded motion, as a replay finds.
TEST_F(SimulateFromRecording, KeepsTheImuAndFollowsTheMotion) {
  const Outcome made = run(render());
  ASSERT_EQ(made.exit_code, 0) << made.err;
  EXPECT_NE(made.out.find("NEES"), std::string::npos) << made.out;
  EXPECT_EQ(read(scratch() / "x/mav0/imu0/data.csv"), read(scratch() / "recorded/mav0/imu0/data.csv"));
  EXPECT_TRUE(Json::parse(read(scratch() / "x/fit.json")).contains("integrated"));
  ASSERT_EQ(run("replay " + in("x") + " --out " + in("results")).exit_code, 0);
  const Outcome compared = run("evaluate " + in("results/trajectory.tum") + " " + truth().string() + " --json");
  ASSERT_EQ(compared.exit_code, 0) << compared.err;
  EXPECT_LT(Json::parse(compared.out)["ate_4dof_m"]["rmse"].get<double>(), 0.05) << compared.out;
}

TEST_F(SimulateFromRecording, SimulatesAnImuIfAsked) {
  ASSERT_EQ(run(render(" --imu simulated")).exit_code, 0);
  EXPECT_NE(read(scratch() / "x/mav0/imu0/data.csv"), read(scratch() / "recorded/mav0/imu0/data.csv"));
}

// Neither the readings nor their calibration change, so a replay corrects them once. A simulated IMU has no such
// errors.
TEST_F(SimulateFromRecording, HandsOnReadingsAsTheyCame) {
  std::ofstream(scratch() / "recorded/mav0/imu0/sensor.yaml", std::ios::app)
      << "accelerometers:\n  M: [1, 0, 0, 0, 1, 0, 0, 0, 1.01]\n";
  ASSERT_EQ(run(render()).exit_code, 0);
  EXPECT_TRUE(read(scratch() / "x/mav0/imu0/data.csv") == read(scratch() / "recorded/mav0/imu0/data.csv"));
  EXPECT_NE(read(scratch() / "x/mav0/imu0/sensor.yaml").find("accelerometers"), std::string::npos);
  const Json fit = Json::parse(read(scratch() / "x/fit.json"));
  EXPECT_LT(fit["accelerometer"]["bias_m_s2"][2].get<double>(), -0.15) << "1 % of gravity less than it was";
  fs::remove_all(scratch() / "x");
  ASSERT_EQ(run(render(" --imu simulated")).exit_code, 0);
  EXPECT_EQ(read(scratch() / "x/mav0/imu0/sensor.yaml").find("accelerometers"), std::string::npos);
}

// More that is refused: tests/drivers/laboratory/simulate/motion_fit_test.cc.
TEST_F(SimulateFromRecording, RefusesATruthWithAGap) {
  std::istringstream rows(read(truth()));
  std::string kept;
  int i = 0;
  for (std::string row; std::getline(rows, row); ++i)
    if (i <= 100 || i > 200) kept += row + "\n";
  write(truth(), kept);
  expect_one_line(run(render()), 2, {truth().string(), "gap"});
  EXPECT_FALSE(fs::exists(scratch() / "x"));
}

TEST_F(SimulateFromRecording, RefusesAFolderWithoutTruthOrCamera) {
  fs::remove_all(truth().parent_path());
  expect_one_line(run(render()), 2, {"state_groundtruth_estimate0", "ground truth"});
  fs::remove(scratch() / "recorded/mav0/cam0/sensor.yaml");
  expect_one_line(run(render()), 2, {"sensor.yaml", "--camera"});
}

// A disk that fills up is an error, and leaves nothing that looks like a flight. (A limit on file size stands for it.)
TEST_F(SimulateCommand, LeavesNothingWhenTheDiskIsFull) {
  expect_one_line(run("simulate --flight hall --duration 1 --out " + in("x"), "trap '' XFSZ; ulimit -f 60; "), 2,
                  {"x/mav0"});
  EXPECT_FALSE(fs::exists(scratch() / "x/mav0"));
  EXPECT_FALSE(fs::exists(scratch() / "x/mav0.partial"));
}

}  // namespace
}  // namespace epiline
