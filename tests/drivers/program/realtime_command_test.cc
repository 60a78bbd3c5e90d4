// `epiline replay --realtime` as a user meets it, over a rendered flight.
#include <chrono>

#include "tests/drivers/program/program.h"

namespace epiline {
namespace {

class RealtimeCommand : public OverARenderedFlight {
 protected:
  static void expect_consistent(const Json& s) {
    EXPECT_EQ(s["images"]["read"].get<int>(), s["images"]["tracked"].get<int>() + s["images"]["skipped"].get<int>() -
                                                  s["images"]["skipped_by_reason"]["refused_by_estimator"].get<int>());
    EXPECT_EQ(s["realtime"]["frames_in"].get<int>(),
              s["realtime"]["frames_out"].get<int>() + s["images"]["skipped_by_reason"]["overtaken"].get<int>());
    EXPECT_EQ(s["realtime"]["frames_out"], s["images"]["tracked"]);
    const Json& images = s["images"];
    EXPECT_EQ(images["read"].get<int>(), images["solved"].get<int>() + images["predicted"].get<int>() +
                                             images["without_pose"].get<int>() + images["skipped"].get<int>());
    std::uint64_t planned = 0;
    for (const auto& level : s["load"]["frames_at_level"].items()) planned += level.value().get<std::uint64_t>();
    EXPECT_LE(planned, images["tracked"].get<std::uint64_t>());
  }

  /// All lines of the one, in their order, are in the other, which may have more.
  static void expect_lines_within(const fs::path& some, const fs::path& all) {
    std::ifstream few(some), many(all);
    for (std::string line, next; std::getline(few, line);) {
      while (std::getline(many, next) && next != line) {
      }
      EXPECT_EQ(next, line);
    }
  }
};

TEST_F(RealtimeCommand, IsTheReplayInOneThreadByteByByteAndTouchesNoHeapNoLockNoNewPage) {
  ASSERT_EQ(replay("offline", "").exit_code, 0);
  EXPECT_TRUE(stats("offline")["realtime"].is_null());
  const std::string config = with_config(kPatient);
  for (const char* speed : {"2", "1", "0.5"}) {  // a computer that had no time for us for a while gets another chance
    const Outcome r = replay("threads", std::string("--realtime --imu-rate --speed ") + speed + " " + config);
    ASSERT_EQ(r.exit_code, 0) << r.err;
    EXPECT_NE(r.out.find("latency"), std::string::npos) << r.out;
    if (stats("threads")["images"]["skipped"] == 0) break;
  }
  const Json s = stats("threads");
  ASSERT_EQ(s["images"]["skipped"], 0);
  const std::string trajectory = read(scratch() / "threads/trajectory.tum");
  EXPECT_GT(std::count(trajectory.begin(), trajectory.end(), '\n'), 60);
  EXPECT_TRUE(trajectory == read(scratch() / "offline/trajectory.tum"));

  expect_consistent(s);
  const std::string at_imu_rate = read(scratch() / "threads/odometry_imu_rate.tum");
  const auto readings = std::count(at_imu_rate.begin(), at_imu_rate.end(), '\n');
  EXPECT_EQ(s["realtime"]["prediction"]["published"].get<std::int64_t>(), readings);
  EXPECT_GT(readings, 3 * std::count(trajectory.begin(), trajectory.end(), '\n')) << "an IMU is faster than a camera";
  EXPECT_EQ(s["realtime"]["prediction"]["jumps"], 1) << "the first";
  EXPECT_LT(s["realtime"]["prediction"]["largest_jump_m"], 0.02);
  EXPECT_TRUE(s["settings"]["realtime"]);
  EXPECT_EQ(s["settings"]["threads"], 6);
  EXPECT_GT(s["timing_ms"]["latency"]["count"], 60);
  EXPECT_GT(s["timing_ms"]["latency"]["p50"], 0);
  ASSERT_EQ(s["realtime"]["threads"].size(), 6u);
  const bool locked = s["realtime"]["memory_locked"];
  expect_quiet_threads(s);
#ifndef EPILINE_SANITIZED
  for (const auto& [name, thread] : s["realtime"]["threads"].items()) {
    EXPECT_GT(thread["stack_used_kib"], 0) << name;
    EXPECT_LE(2 * thread["stack_used_kib"].get<int>(), thread["stack_kib"].get<int>()) << name;
  }
#endif
  for (const auto& [name, ring] : s["realtime"]["rings"].items()) EXPECT_EQ(ring["dropped"], 0) << name;
  EXPECT_NE(read(scratch() / "threads/report.html").find("latency: image timestamp to odometry"), std::string::npos);
  if (!locked) GTEST_SKIP() << "memory may not be locked here: page faults were not looked at";
}

// At a tenth of its pace the flight takes 50 s.
TEST_F(RealtimeCommand, ASignalEndsItWithTheResultsSoFar) {
  for (const char* signal : {"TERM", "INT"}) {
    const auto start = std::chrono::steady_clock::now();
    const Outcome r =
        run("replay " + in_quotes(flight_) + " --out " + in_quotes(scratch() / signal) + " --realtime --speed 0.1",
            "timeout --foreground --preserve-status -s " + std::string(signal) + " 4 ");  // one signal, not two
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
    EXPECT_LT(took.count(), 20);
    EXPECT_LE(r.exit_code, 1) << "1: it had no time to start";
    const Json s = stats(signal);
    EXPECT_GT(s["images"]["read"], 0);
    EXPECT_TRUE(fs::exists(scratch() / signal / "trajectory.tum"));
  }
}

// A record of the whole flight is replayed to the very trajectory, with the recorded tracks and with the images; making
// it, and one in mid-flight, costs the threads no heap call, lock or page.
TEST_F(RealtimeCommand, ARecordIsReplayedToTheSameTrajectory) {
  // no deadline: what a late computer leaves out would depend on the clock
  // a shear that a binary number holds, so that its inverse is exact
  write(scratch() / "imu.yaml",
        read(flight_ / "mav0/imu0/sensor.yaml") + "accelerometers:\n  M: [1, 0, 0, 0.0078125, 1, 0, 0, 0, 1]\n");
  const std::string config = with_config(
      kPatient + ("[estimator]\nkeyframes = 9\n[imu]\ncalibration = \"" + (scratch() / "imu.yaml").string()) + "\"\n");
  for (const std::string images : {"", " --record-images"}) {
    const fs::path records = scratch() / ("records" + images.substr(0, 4));
    Json s;
    bool complete = false;  // on a busy computer images are lost on their way to the record: then once more, slower
    for (const char* speed : {"2", "0.5", "0.1"}) {
      fs::remove_all(records);
      const std::string signal = " & p=$!; until [ -d '" + records.string() +
                                 "' ] || ! kill -0 $p; do sleep 0.05; done; sleep 1; kill -USR1 $p; wait $p";
      const Outcome r = run("replay " + in_quotes(flight_) + " --realtime --speed " + speed + " " + config + " --out " +
                                in_quotes(scratch() / "run") + " --record " + in_quotes(records) + images,
                            "", signal);
      ASSERT_EQ(r.exit_code, 0) << r.err;
      s = stats("run");
      complete = s["realtime"]["images_not_logged"] == 0 && s["realtime"]["imu_late"] == 0 &&
                 s["realtime"]["recorder"]["lost"] == 0;
      if (complete) break;
    }
    ASSERT_TRUE(complete) << "not even at a tenth of the flight's speed";
    const Json& recorder = s["realtime"]["recorder"];
    EXPECT_TRUE(recorder["failed"].empty());
    ASSERT_GE(recorder["written"].size(), 1u);  // two, unless the signal came after the flight
    EXPECT_EQ(recorder["written"].size(), s["events"]["by_name"]["record_written"].get<std::size_t>());
    expect_quiet_threads(s);
    const fs::path record(recorder["written"].back().get<std::string>());
    EXPECT_EQ(fs::exists(record / "mav0/cam0/data.csv"), !images.empty());
    ASSERT_EQ(run("replay " + in_quotes(record) + " --config " + in_quotes(record / "config.toml") + " --out " +
                  in_quotes(scratch() / "again"))
                  .exit_code,
              0);
    const std::string trajectory = read(scratch() / "run/trajectory.tum");
    EXPECT_GT(std::count(trajectory.begin(), trajectory.end(), '\n'), 60);
    EXPECT_TRUE(trajectory == read(scratch() / "again/trajectory.tum")) << images;
    EXPECT_TRUE(trajectory == read(record / "trajectory.tum"));
    expect_lines_within(scratch() / "again/events.txt", scratch() / "run/events.txt");
  }
}

TEST_F(RealtimeCommand, ARecordThatCannotBeWrittenIsSaidAndTheFlightGoesOn) {
  write(scratch() / "file", "");
  const Outcome r = replay("out", "--realtime --speed 4 --record " + in_quotes(scratch() / "file"));
  EXPECT_EQ(r.exit_code, 0) << r.err;
  EXPECT_NE(r.out.find("note      record failed: "), std::string::npos) << r.out;
  EXPECT_NE(read(scratch() / "out/events.txt").find("record_failed number=1 reason=end"), std::string::npos);
  EXPECT_EQ(stats("out")["realtime"]["recorder"]["failed"].size(), 1u);
}

TEST_F(RealtimeCommand, OverloadLosesImagesCountsThemAndGoesOn) {
  const Outcome r = replay("fast", "--realtime --speed 50");
  ASSERT_TRUE(r.exit_code == 0 || r.exit_code == 1) << r.err;  // it may have seen too little to start
  const Json s = stats("fast");
  EXPECT_GT(s["images"]["skipped"], 0);
  expect_consistent(s);
}

// Two rounds of five seconds, six seconds of gap between them.
TEST_F(RealtimeCommand, ALoopedFlightStartsAnewInEachRound) {
  const Outcome r = replay("loop", "--realtime --loop 15 --speed 4");
  ASSERT_EQ(r.exit_code, 0) << r.err;
  const Json s = stats("loop");
  EXPECT_GE(s["resets"], 1);
  EXPECT_GT(s["images"]["read"], 1.5 * 100);
  expect_consistent(s);
}

// No solve fits into a hundredth of a millisecond: the IMU predicts, twice a second a solve is let through, and health
// says so.
TEST_F(RealtimeCommand, WithoutTimeToSolveItPredictsAndSaysSo) {
  const Outcome r = replay("short", "--deadline-ms 0.01");
  ASSERT_EQ(r.exit_code, 0) << r.err;
  const Json s = stats("short");
  const Json& load = s["load"];
  EXPECT_GT(load["frames_at_level"]["prediction_only"], 30);
  EXPECT_GT(load["solved_to_survive"], 4);
  EXPECT_GT(s["state_seconds"]["degraded"], 1);
  EXPECT_EQ(s["state_seconds"]["lost"], 0);
  EXPECT_NE(r.out.find("predicted only"), std::string::npos) << r.out;
  EXPECT_NE(read(scratch() / "short/events.txt").find("load_level from=full"), std::string::npos);
}

// Without privileges it runs all the same, and says once what it did not get.
TEST_F(RealtimeCommand, MissingPrivilegesAreSaidAndNoFailure) {
  const Outcome r =
      run("replay " + in_quotes(flight_) + " --realtime --speed 2 --out " + in_quotes(scratch() / "plain"),
          "setpriv --bounding-set -sys_nice,-ipc_lock --inh-caps -all prlimit --memlock=8388608 ");
  if (r.err.find("setpriv") != std::string::npos || r.err.find("prlimit") != std::string::npos)
    GTEST_SKIP() << "privileges cannot be given up here: " << r.err;
  ASSERT_EQ(r.exit_code, 0) << r.err;
  const Json s = stats("plain");
  EXPECT_FALSE(s["realtime"]["shortfalls"].empty());
  EXPECT_EQ(s["realtime"]["threads"]["imu"]["priority"], 0);
  EXPECT_NE(r.out.find("note      no real-time priority for imu, capture"), std::string::npos) << r.out;
}

TEST_F(RealtimeCommand, SpeedAndRecordsBelongToRealTime) {
  for (const std::string option : {"--speed 2", "--record records"})
    expect_one_line(replay("x", option), 2, {"--realtime"});
}

}  // namespace
}  // namespace epiline
