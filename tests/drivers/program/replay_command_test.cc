// The program as a user meets it: run, exit code, stderr, files.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "tests/drivers/program/program.h"

namespace epiline {
namespace {

constexpr std::int64_t kStart_ns = 1'403'636'584'763'555'584;

std::string image_bytes(int width, int height) {
  return "P5\n" + std::to_string(width) + " " + std::to_string(height) + "\n255\n" +
         std::string(static_cast<std::size_t>(width * height), 'x');
}

constexpr const char* kCamera = R"(T_BS:
  cols: 4
  rows: 4
  data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
resolution: [128, 96]
camera_model: pinhole
intrinsics: [100, 100, 64, 48]
distortion_model: radial-tangential
distortion_coefficients: [-0.28, 0.07, 0.0002, 0]
)";

/// A second of grey images and a resting IMU: complete and readable, but nothing to see.
class MadeUpFlight : public CommandTest {
 protected:
  void SetUp() override {
    CommandTest::SetUp();
    write(mav / "cam0/sensor.yaml", kCamera);
    std::string list = "#timestamp [ns],filename\n", imu = "#timestamp [ns],w,w,w,a,a,a\n";
    for (int i = 0; i < 20; ++i) {
      const std::string ns = std::to_string(kStart_ns + i * 50'000'000LL);
      list += ns + "," + ns + ".pgm\n";
      write(mav / "cam0/data" / (ns + ".pgm"), image_bytes(128, 96));
    }
    for (int i = -10; i < 210; ++i)
      imu += std::to_string(kStart_ns + i * 5'000'000LL) + ",0.001,0.002,0.003,0.01,0.02,9.81\n";
    write(mav / "cam0/data.csv", list);
    write(mav / "imu0/data.csv", imu);
  }
  Outcome replay(const std::string& more = "") {
    return run("replay " + in_quotes(flight) + " --out " + in_quotes(out) + " " + more);
  }
  Json stats() const { return Json::parse(read(out / "stats.json")); }

  fs::path flight = scratch() / "flight", mav = flight / "mav0", out = scratch() / "out";
};

TEST_F(MadeUpFlight, WithoutTextureTheRunFailsButLeavesItsFiles) {
  const Outcome r = replay();
  expect_one_line(r, 1, {"the estimator did not start in 20 images"});
  EXPECT_TRUE(fs::exists(out / "trajectory.tum"));
  EXPECT_TRUE(fs::exists(out / "report.html"));
  const Json s = stats();
  EXPECT_EQ(s["images"]["read"], 20);
  EXPECT_EQ(s["images"]["tracked"], 20);
  EXPECT_FALSE(s["initialisation"]["done"]);
  EXPECT_TRUE(s["initialisation"]["seconds_after_first_image"].is_null());
  EXPECT_FALSE(s["dataset"]["has_ground_truth"]);
  EXPECT_TRUE(s["error"]["ate_4dof_m"]["rmse"].is_null());
  EXPECT_NE(r.out.find("sensor.yaml does not exist: assuming the noise densities"), std::string::npos) << r.out;
}

TEST_F(MadeUpFlight, EveryPromisedFieldIsThere) {
  replay();
  const Json s = stats();
  const std::vector<std::pair<std::string, std::vector<std::string>>> fields = {
      {"program", {"version", "commit", "compiler", "build_type", "simd"}},
      {"dataset", {"path", "duration_s", "images", "imu_samples", "has_ground_truth"}},
      {"settings", {"visual_factor", "keyframes", "max_features", "deadline_ms", "realtime", "threads"}},
      {"images", {"read", "tracked", "solved", "skipped", "skipped_by_reason"}},
      {"imu", {"read", "used", "out_of_order", "duplicate", "not_finite", "gaps", "saturated"}},
      {"watch", {"imu", "images"}},
      {"initialisation", {"done", "seconds_after_first_image", "kind", "attempts", "refused_by_reason"}},
      {"state_seconds", {"initialising", "tracking", "degraded", "lost"}},
      {"timing_ms", {"track", "solve", "marginalise", "estimate", "frame", "latency"}},
      {"cpu_ms", {"track", "solve", "marginalise", "estimate", "frame"}},
      {"solver", {"iterations_mean", "residuals_mean", "state_size_mean", "deadline_hits"}},
      {"tracks", {"per_image_mean", "length_mean", "rejected_share", "own_parts_share"}},
      {"memory", {"peak_rss_mib", "heap_allocations_after_start", "page_faults_after_start"}},
      {"error",
       {"poses", "coverage", "ate_4dof_m", "ate_se3_m", "ate_sim3_m", "scale_error", "yaw_drift_deg", "rpe", "motion",
        "nees_position", "nees_yaw", "nees_tilt", "nees_velocity", "calibration_curve"}}};
  EXPECT_EQ(s["schema"], 1);
  EXPECT_TRUE(s.contains("resets"));
  EXPECT_TRUE(s.contains("realtime"));
  for (const auto& [block, names] : fields) {
    for (const std::string& name : names) EXPECT_TRUE(s[block].contains(name)) << block << "." << name;
  }
  for (const char* clock : {"timing_ms", "cpu_ms"}) {
    for (const auto& [stage, block] : s[clock].items()) {
      for (const char* name : {"count", "mean", "p50", "p90", "p99", "p999", "max"})
        EXPECT_TRUE(block.contains(name)) << clock << "." << stage << "." << name;
    }
  }
}

TEST_F(MadeUpFlight, BadSamplesAndDoubledImagesAreCountedNotFatal) {
  std::string imu = read(mav / "imu0/data.csv");
  const std::string line = std::to_string(kStart_ns + 100'000'000) + ",0.001,0.002,0.003,0.01,0.02,9.81\n";
  const std::size_t at = imu.find(line);
  ASSERT_NE(at, std::string::npos);
  const std::string old = std::to_string(kStart_ns + 2'000'000) + ",0,0,0,0,0,9.81\n";
  const std::string broken = std::to_string(kStart_ns + 101'000'000) + ",nan,0,0,0,inf,9.81\n";
  imu.insert(at + line.size(), line + old + broken);
  write(mav / "imu0/data.csv", imu);
  std::string list = read(mav / "cam0/data.csv");
  const std::string first = list.substr(list.find('\n') + 1, list.find('\n', list.find('\n') + 1) - list.find('\n'));
  write(mav / "cam0/data.csv", list.substr(0, list.find('\n') + 1) + first + list.substr(list.find('\n') + 1) + first);
  EXPECT_EQ(replay().exit_code, 1);
  const Json s = stats();
  EXPECT_EQ(s["imu"]["duplicate"], 1);
  EXPECT_EQ(s["imu"]["out_of_order"], 1);
  EXPECT_EQ(s["imu"]["not_finite"], 1);
  const std::string events = read(out / "events.txt");
  for (const char* reason : {"duplicate", "out_of_order", "not_finite"})
    EXPECT_NE(events.find(std::string(" imu_refused on=1 readings=1 reason=") + reason), std::string::npos) << events;
  EXPECT_EQ(s["images"]["read"], 22);
  EXPECT_EQ(s["images"]["tracked"], 20);
  EXPECT_EQ(s["images"]["skipped_by_reason"]["duplicate"], 1);
  EXPECT_EQ(s["images"]["skipped_by_reason"]["out_of_order"], 1);
}

// Of one thread and of several the same lines of the IMU: its gate sees the same stamps and arrivals.
TEST_F(MadeUpFlight, FaultsOfTheInputsAreTold) {
  const auto told_of_imu = [&](const std::string& more) {
    replay("--fault imu-behind@0.3:0.3 " + more);
    std::string lines;
    std::ifstream events(out / "events.txt");
    for (std::string line; std::getline(events, line);)
      if (line.find(" imu_refused ") != std::string::npos || line.find(" clock_jump ") != std::string::npos)
        lines += line + '\n';
    return lines;
  };
  const std::string lines = told_of_imu("");
  EXPECT_NE(read(out / "events.txt").find(" lens_covered on=1 images=1\n"), std::string::npos) << "grey images";
  EXPECT_NE(lines.find(" clock_jump source=imu correction_ns=500000000\n"), std::string::npos) << lines;
  EXPECT_NE(lines.find(" clock_jump source=imu correction_ns=0\n"), std::string::npos) << lines;
  EXPECT_EQ(told_of_imu("--realtime"), lines);
}

TEST_F(MadeUpFlight, StartAndDurationChooseImages) {
  replay("--start 0.2 --duration 0.5");
  EXPECT_EQ(stats()["images"]["read"], 11);
  EXPECT_EQ(stats()["dataset"]["images"], 20);
  expect_one_line(replay("--start 100"), 2, {"no image between --start and --duration"});
}

TEST_F(MadeUpFlight, TheLayoutOfTumViIsReadAsItComes) {
  fs::remove(mav / "cam0/sensor.yaml");
  write(flight / "dso/camchain.yaml", R"(cam0:
  T_cam_imu: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
  camera_model: pinhole
  distortion_coeffs: [0.003, 0.0007, -0.002, 0.0002]
  distortion_model: equidistant
  intrinsics: [100, 100, 64, 48]
  resolution: [128, 96]
)");
  write(flight / "dso/imu_config.yaml",
        "accelerometer_noise_density: 0.0014\naccelerometer_random_walk: 8.6e-05\n"
        "gyroscope_noise_density: 8.0e-05\ngyroscope_random_walk: 2.2e-06\nupdate_rate: 200\n");
  write(mav / "mocap0/data.csv", std::to_string(kStart_ns) + ",0,0,0,1,0,0,0\n");
  const Outcome r = replay();
  EXPECT_EQ(r.exit_code, 1) << r.err;  // grey images: never started, but everything was found
  EXPECT_TRUE(stats()["dataset"]["has_ground_truth"]);
  EXPECT_EQ(r.out.find("sensor.yaml does not exist"), std::string::npos) << r.out;
}

// The report names the first image of each kind of damage, with one thread and with several.
TEST_F(MadeUpFlight, ImagesThatCannotBeReadAreLeftOut) {
  const auto image = [&](int i) { return mav / "cam0/data" / (std::to_string(kStart_ns + i * 50'000'000LL) + ".pgm"); };
  fs::remove(image(0));
  fs::remove(image(7));
  write(image(3), "");
  write(image(12), "no image");
  for (const char* more : {"", "--realtime"}) {
    const Outcome r = replay(more);
    EXPECT_EQ(r.exit_code, 1) << r.err;  // grey images: never started
    EXPECT_EQ(stats()["images"]["read"], 20);
    EXPECT_EQ(stats()["images"]["skipped_by_reason"]["unreadable"], 4);
    EXPECT_EQ(stats()["images"]["tracked"], 16);
    EXPECT_NE(r.out.find("2 of 20 images left out, the first: "), std::string::npos) << r.out;
    EXPECT_NE(r.out.find("cam0/data.csv:2: " + image(0).string() + " does not exist"), std::string::npos) << r.out;
    EXPECT_NE(r.out.find("cam0/data.csv:5: " + image(3).string() + " is empty"), std::string::npos) << r.out;
  }
}

/// What is broken in the flight, and what the line must say. More: tests of what reads each file.
struct Damage {
  const char* name;
  std::function<void(const fs::path& mav)> apply;
  std::vector<std::string> parts;
  friend void PrintTo(const Damage& damage, std::ostream* out) { *out << damage.name; }
};

void replace_in(const fs::path& path, const std::string& from, const std::string& to) {
  std::string text = read(path);
  const std::size_t at = text.find(from);
  ASSERT_NE(at, std::string::npos);
  write(path, text.replace(at, from.size(), to));
}

const std::string kFirstImage = std::to_string(kStart_ns) + ".pgm";

const Damage kDamages[] = {
    {"NoFolder", [](const fs::path& mav) { fs::remove_all(mav.parent_path()); }, {"flight: does not exist"}},
    {"NoCalibration",
     [](const fs::path& mav) { fs::remove(mav / "cam0/sensor.yaml"); },
     {"cam0/sensor.yaml: does not exist"}},
    {"NoImageList",
     [](const fs::path& mav) { fs::remove(mav / "cam0/data.csv"); },
     {"cam0/data.csv: does not exist", "tracks.csv"}},
    {"EveryImageMissing",
     [](const fs::path& mav) { fs::remove_all(mav / "cam0/data"); },
     {"data.csv:2: ", kFirstImage, "does not exist"}},
    {"ImageOfAnotherSize",
     [](const fs::path& mav) { write(mav / "cam0/data" / kFirstImage, image_bytes(64, 96)); },
     {"64x96", "128x96"}},
    {"TruncatedCsv",
     [](const fs::path& mav) {
       const std::string text = read(mav / "imu0/data.csv");
       write(mav / "imu0/data.csv", text.substr(0, text.size() - 12));
     },
     {"imu0/data.csv:221: 5 values; expected 7"}},
    {"TooManyIntrinsics",
     [](const fs::path& mav) { replace_in(mav / "cam0/sensor.yaml", "64, 48]", "64, 48, 1]"); },
     {"sensor.yaml:7: 5 numbers"}},
    {"NoRotation",
     [](const fs::path& mav) { replace_in(mav / "cam0/sensor.yaml", "data: [1,", "data: [2,"); },
     {"sensor.yaml:4: ", "not a rigid motion"}},
    {"NotYaml",
     [](const fs::path& mav) { write(mav / "cam0/sensor.yaml", "a: [1, 2\nb: 3\n"); },
     {"sensor.yaml:2: not YAML"}},
    {"EmptyImu",
     [](const fs::path& mav) { write(mav / "imu0/data.csv", "#timestamp\n"); },
     {"imu0/data.csv: lists no IMU sample"}},
    {"NoImu", [](const fs::path& mav) { fs::remove(mav / "imu0/data.csv"); }, {"imu0/data.csv: does not exist"}},
};

class DamagedFlight : public MadeUpFlight, public testing::WithParamInterface<Damage> {};

TEST_P(DamagedFlight, IsOneClearLineAndExitCodeTwo) {
  GetParam().apply(mav);
  expect_one_line(replay(), 2, GetParam().parts);
}

INSTANTIATE_TEST_SUITE_P(All, DamagedFlight, testing::ValuesIn(kDamages),
                         [](const auto& damage) { return damage.param.name; });

TEST_F(MadeUpFlight, WrongUsageIsExitCodeTwo) {
  expect_one_line(run(""), 2, {});
  expect_one_line(run("fly"), 2, {"fly"});
  expect_one_line(run("replya"), 2, {"unknown command \"replya\"", "expected \"replay\""});
  expect_one_line(replay("--set tracker.max_features=0"), 2, {"--set tracker.max_features=0", "1 to 400"});
  expect_one_line(replay("--sideways"), 2, {"--sideways"});
  expect_one_line(replay("--visual-factor guess"), 2, {"guess", "`epiline-study replay --help`"});
  expect_one_line(replay("--config /nonexistent.toml"), 2, {"/nonexistent.toml"});
  expect_one_line(replay(with_config("[estimator]\nkeyframes = 40\n")), 2,
                  {"flight.toml:2: estimator.keyframes = 40", "2 to 20"});
  EXPECT_EQ(run("--help").exit_code, 0);
  EXPECT_EQ(run("--version").exit_code, 0);
}

/// Recorded flights, where they are at hand.
class RecordedFlight : public MadeUpFlight {
 protected:
  void SetUp() override {
    const char* folder = std::getenv("EPILINE_DATA");
    data = folder ? fs::path(folder) : fs::path(EPILINE_SOURCE).parent_path() / "shared/data";
    if (!fs::exists(data)) GTEST_SKIP() << "no recorded flights in " << data << " (EPILINE_DATA)";
    fs::remove_all(scratch());
  }
  fs::path data;
};

TEST_F(RecordedFlight, TwoReplaysOfImagesAgreeBitByBitAndAreAccurate) {
  const std::string replay = "replay '" + (data / "euroc_MH_01").string() + "' --duration 6 --quiet --out '";
  ASSERT_EQ(run(replay + (scratch() / "a").string() + "'").exit_code, 0);
  ASSERT_EQ(run(replay + (scratch() / "b").string() + "'").exit_code, 0);
  const std::string a = read(scratch() / "a/trajectory.tum");
  EXPECT_GT(std::count(a.begin(), a.end(), '\n'), 80);
  EXPECT_EQ(a, read(scratch() / "b/trajectory.tum"));
  EXPECT_NE(a.find("1403636588.763555584 "), std::string::npos);  // the image's nanoseconds, all of them
  const Json s = Json::parse(read(scratch() / "a/stats.json"));
  EXPECT_LT(s["error"]["ate_4dof_m"]["rmse"], 0.05);
  EXPECT_TRUE(s["initialisation"]["done"]);
  const Json& heap = s["memory"]["heap_allocations_after_start"];
  EXPECT_TRUE(heap.is_null() || heap == 0) << heap;
  // The same errors from the files alone.
  const Outcome evaluation = run("evaluate --json '" + (scratch() / "a/trajectory.tum").string() + "' '" +
                                 (data / "euroc_MH_01/mav0/state_groundtruth_estimate0/data.csv").string() + "'");
  ASSERT_EQ(evaluation.exit_code, 0) << evaluation.err;
  EXPECT_NEAR(Json::parse(evaluation.out)["ate_4dof_m"]["rmse"], s["error"]["ate_4dof_m"]["rmse"], 1e-6);
  // What the estimator claims is in odometry.csv.
  EXPECT_TRUE(Json::parse(evaluation.out)["nees_position"].is_null());
  const std::string files = " '" + (scratch() / "a/odometry.csv").string() + "' '" +
                            (data / "euroc_MH_01/mav0/state_groundtruth_estimate0/data.csv").string() + "'";
  const Json judged = Json::parse(run("evaluate --json" + files).out);
  for (const char* key : {"nees_position", "nees_yaw", "nees_tilt", "nees_velocity"})
    EXPECT_NEAR(judged[key], s["error"][key], 1e-5 * s["error"][key].get<double>()) << key;
  const Json &curve = judged["calibration_curve"]["yaw"], &wanted = s["error"]["calibration_curve"]["yaw"];
  EXPECT_EQ(curve["errors"], wanted["errors"]);
  EXPECT_NEAR(curve["share"][4], wanted["share"][4], 0.02);  // rounding may move a pose or two over the edge
  const std::string text = run("evaluate" + files).out;
  EXPECT_NE(text.find("\nclaimed        NEES  10  20 "), std::string::npos) << text;
}

TEST_F(RecordedFlight, RecordedTracksNeedNoImages) {
  const Outcome r = run("replay '" + (data / "imu_april_tracks").string() + "' --duration 5 --camera cam1 --out '" +
                        out.string() + "'");
  ASSERT_TRUE(r.exit_code == 0 || r.exit_code == 1) << r.err;
  const Json s = stats();
  for (const char* clock : {"timing_ms", "cpu_ms"}) {
    EXPECT_EQ(s[clock]["track"]["count"], 0);
    EXPECT_TRUE(s[clock]["track"]["mean"].is_null());
  }
  EXPECT_TRUE(s["settings"]["max_features"].is_null());
  EXPECT_GT(s["tracks"]["per_image_mean"], 20);
  EXPECT_EQ(s["images"]["tracked"], s["images"]["read"]);
}

}  // namespace
}  // namespace epiline
