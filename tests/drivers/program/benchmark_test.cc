// tests/flights/benchmark as a user meets it: tiny made-up flights, one of them broken, and what the tables say of
// them.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <string>
#include <thread>
#include <vector>

#include "tests/drivers/program/program.h"

namespace epiline {
namespace {

const std::string kScript = EPILINE_SOURCE "/tests/flights/benchmark";

class Benchmark : public CommandTest {
 protected:
  void SetUp() override {
    CommandTest::SetUp();
    for (const fs::path& flight : {agile, hover}) {
      const Outcome made = run("simulate --tracks --flight " + flight.filename().string() +
                               " --duration 4 --pixel-noise 0.5 --out " + in_quotes(flight));
      ASSERT_EQ(made.exit_code, 0) << made.err;
    }
  }
  Outcome benchmark(const std::string& arguments, const fs::path& folder) {
    return run(arguments + " --factors track,epipolar --out " + in_quotes(folder), kScript + " --program ");
  }
  static Json json(const fs::path& folder) { return Json::parse(read(folder / "benchmark.json")); }
  static Json result(const Json& json, const std::string& dataset, const std::string& factor) {
    for (const Json& r : json["results"])
      if (r["dataset"] == dataset && r["factor"] == factor) return r;
    ADD_FAILURE() << "no result of " << dataset << ", " << factor;
    return {};
  }

  fs::path agile = scratch() / "sim/agile", hover = scratch() / "sim/hover", out = scratch() / "out";
  std::string flights = in_quotes(agile) + " " + in_quotes(hover);
};

TEST_F(Benchmark, ComparesFactorsOverDataSets) {
  const Outcome r = benchmark(flights + " --repeat 2", out);
  ASSERT_EQ(r.exit_code, 0) << r.err;
  EXPECT_TRUE(r.err.empty()) << r.err;  // no progress where there is no terminal
  const Json b = json(out);
  EXPECT_EQ(b["schema"], 1);
  EXPECT_EQ(b["settings"]["factors"], Json({"track", "epipolar"}));
  ASSERT_EQ(b["runs"].size(), 8u);
  ASSERT_EQ(b["results"].size(), 4u);
  for (const Json& one : b["runs"]) {
    EXPECT_EQ(one["outcome"], "done");
    EXPECT_EQ(one["stats"], Json::parse(read(out / one["folder"].get<std::string>() / "stats.json")));
    EXPECT_EQ(one["stats"]["settings"]["visual_factor"], one["factor"]);
  }
  for (const Json& cell : b["results"]) {
    EXPECT_EQ(cell["done"], 2);
    EXPECT_FALSE(cell["diverged"]);
    EXPECT_TRUE(cell["repetitions_identical"].get<bool>());
    for (const char* key :
         {"ate_4dof_m",       "ate_se3_m",        "rpe_1m_percent",       "yaw_drift_abs_deg", "start_s",
          "coverage",         "resets",           "nees_position",        "nees_yaw",          "nees_tilt",
          "nees_velocity",    "solve_ms_mean",    "solve_ms_p50",         "solve_ms_p99",      "solve_ms_max",
          "estimate_ms_mean", "solve_cpu_ms_p50", "estimate_cpu_ms_mean", "iterations_mean",   "residuals_mean",
          "state_size_mean",  "peak_rss_mib"})
      EXPECT_TRUE(cell["median"][key].is_number()) << key;
    EXPECT_TRUE(cell["median"]["track_ms_mean"].is_null());  // recorded tracks: nothing was tracked
    EXPECT_TRUE(cell["median"]["track_cpu_ms_mean"].is_null());
    EXPECT_LT(cell["median"]["ate_4dof_m"], 0.1);
  }
  EXPECT_EQ(read(out / "benchmark.txt"), r.out);
  for (const char* part : {"Error and solve time: sim", "Processor time per image, ms", "\nmedian "})
    EXPECT_NE(r.out.find(part), std::string::npos) << part;
}

// Independent of the program's own arithmetic: from the figures of the single runs.
TEST_F(Benchmark, RatiosAreMediansOfTheDataSets) {
  ASSERT_EQ(benchmark(flights, out).exit_code, 0);
  const Json b = json(out);
  const auto ratio = [&](const char* dataset, const char* key) {
    return result(b, dataset, "epipolar")["median"][key].get<double>() /
           result(b, dataset, "track")["median"][key].get<double>();
  };
  ASSERT_EQ(b["ratios"].size(), 1u);
  EXPECT_EQ(b["ratios"][0]["factor"], "epipolar");
  EXPECT_EQ(b["ratios"][0]["to"], "track");
  for (const char* key : {"ate_4dof_m", "solve_ms_mean", "residuals_mean"}) {
    const Json& r = b["ratios"][0]["ratio"][key];
    const double first = ratio("agile", key), second = ratio("hover", key);
    EXPECT_NEAR(r["median"], 0.5 * (first + second), 1e-12) << key;
    EXPECT_NEAR(r["min"], std::min(first, second), 1e-12) << key;
    EXPECT_NEAR(r["max"], std::max(first, second), 1e-12) << key;
    EXPECT_EQ(r["datasets"], 2) << key;
  }
}

// Independent of the program's own arithmetic: from the figures of the single runs.
TEST_F(Benchmark, AnEnsembleShowsMediansAndSpreads) {
  const Outcome r = benchmark(flights + " --ensemble 3", out);
  ASSERT_EQ(r.exit_code, 0) << r.err;
  const Json b = json(out);
  EXPECT_EQ(b["settings"]["ensemble"], 3);
  ASSERT_EQ(b["runs"].size(), 12u);
  for (const char* key : {"ate_4dof_m", "nees_position", "nees_yaw", "nees_tilt", "nees_velocity"}) {
    std::vector<double> values;
    for (const Json& one : b["runs"]) {
      if (one["dataset"] != "agile" || one["factor"] != "track") continue;
      EXPECT_EQ(one["stats"]["images"]["read"], 81 - one["repetition"].get<int>());  // starts later each
      const Json& error = one["stats"]["error"];
      values.push_back(std::string(key) == "ate_4dof_m" ? error[key]["rmse"].get<double>() : error[key].get<double>());
    }
    ASSERT_EQ(values.size(), 3u);
    std::sort(values.begin(), values.end());
    EXPECT_LT(values[0], values[2]) << key;
    const Json cell = result(b, "agile", "track");
    EXPECT_NEAR(cell["median"][key], values[1], 1e-12) << key;
    EXPECT_NEAR(cell["spread"][key]["min"], values[0], 1e-12) << key;
    EXPECT_NEAR(cell["spread"][key]["max"], values[2], 1e-12) << key;
    EXPECT_NEAR(cell["spread"][key]["q25"], 0.5 * (values[0] + values[1]), 1e-12) << key;
  }
  double inside = 0, errors = 0;
  for (const Json& one : b["runs"]) {
    if (one["dataset"] != "agile" || one["factor"] != "track") continue;
    const Json& curve = one["stats"]["error"]["calibration_curve"]["velocity"];
    inside += curve["errors"].get<double>() * curve["share"][4].get<double>();
    errors += curve["errors"].get<double>();
  }
  const Json pooled = result(b, "agile", "track")["calibration_curve"]["velocity"];
  EXPECT_EQ(pooled["errors"], errors);
  EXPECT_NEAR(pooled["share"][4], inside / errors, 1e-12);
  for (const char* part : {"\nEnsemble\n", "\nCalibration curve\n", "3/3"})
    EXPECT_NE(r.out.find(part), std::string::npos) << part;
  // The first run is the flight as it is; the second differs from one that starts as late by gravity's seventh digit.
  ASSERT_EQ(run("replay " + in_quotes(agile) + " --quiet --out " + in_quotes(scratch() / "plain")).exit_code, 0);
  EXPECT_EQ(read(scratch() / "plain/trajectory.tum"), read(out / "runs/agile/track/1/trajectory.tum"));
  ASSERT_EQ(
      run("replay " + in_quotes(agile) + " --start 0.03 --quiet --out " + in_quotes(scratch() / "late")).exit_code, 0);
  const std::string late = read(scratch() / "late/trajectory.tum"),
                    second = read(out / "runs/agile/track/2/trajectory.tum");
  EXPECT_EQ(std::count(late.begin(), late.end(), '\n'), std::count(second.begin(), second.end(), '\n'));
  EXPECT_NE(late, second);
}

TEST_F(Benchmark, SideBySideGivesTheSameFigures) {
  ASSERT_EQ(benchmark(flights + " --jobs 1", scratch() / "one").exit_code, 0);
  ASSERT_EQ(benchmark(flights + " --jobs 2", scratch() / "two").exit_code, 0);
  const Json one = json(scratch() / "one"), two = json(scratch() / "two");
  ASSERT_EQ(one["results"].size(), two["results"].size());
  for (std::size_t i = 0; i < one["results"].size(); ++i) {
    const Json &a = one["results"][i]["median"], &b = two["results"][i]["median"];
    for (const auto& [key, value] : a.items()) {
      if (key.find("_ms_") != std::string::npos || key == "peak_rss_mib") continue;
      EXPECT_EQ(value, b[key]) << key;
    }
  }
}

TEST_F(Benchmark, WhatFailsIsARowThatSaysSo) {
  const fs::path blind = scratch() / "sim/blind", cut = scratch() / "sim/cut";
  fs::copy(agile, cut, fs::copy_options::recursive);
  write(cut / "mav0/imu0/data.csv", "#timestamp\n1,2,3\n");
  fs::copy(agile, blind, fs::copy_options::recursive);  // points that stand still in a flight that does not
  std::string tracks;
  for (int image = 0; image < 40; ++image) {
    for (int point = 0; point < 40; ++point)
      tracks += std::to_string(100'000'000'000 + image * 50'000'000LL) + "," + std::to_string(point) + "," +
                std::to_string(100 + 10 * point) + "," + std::to_string(100 + (37 * point) % 250) + "\n";
  }
  write(blind / "mav0/cam0/tracks.csv", tracks);
  const Outcome r = benchmark(in_quotes(agile) + " " + in_quotes(cut) + " " + in_quotes(blind) + " /nonexistent", out);
  EXPECT_EQ(r.exit_code, 0) << r.err;
  const Json b = json(out);
  EXPECT_EQ(result(b, "agile", "track")["outcome"], "done");
  EXPECT_EQ(result(b, "cut", "track")["outcome"], "refused");
  EXPECT_EQ(result(b, "blind", "track")["outcome"], "never started");
  EXPECT_EQ(result(b, "nonexistent", "epipolar")["outcome"], "refused");
  EXPECT_TRUE(result(b, "cut", "track")["median"]["ate_4dof_m"].is_null());
  EXPECT_EQ(b["ratios"][0]["ratio"]["ate_4dof_m"]["datasets"], 1);
  for (const char* part : {"imu0/data.csv:2: 3 values; expected 7", "the estimator did not start in 40 images",
                           "/nonexistent: does not exist"})
    EXPECT_NE(r.out.find(part), std::string::npos) << part << " not in " << r.out;
}

TEST_F(Benchmark, NothingDoneIsAFailure) {
  expect_one_line(benchmark("/nonexistent", out), 1, {"none of 2 runs gave a trajectory"});
  EXPECT_TRUE(fs::exists(out / "benchmark.txt"));
}

TEST_F(Benchmark, WrongUsageIsExitCodeTwo) {
  expect_one_line(run(in_quotes(agile) + " --factors guess --out " + in_quotes(out), kScript + " --program "), 2,
                  {"guess"});
  expect_one_line(benchmark("", out), 2, {"DATASET"});
  expect_one_line(benchmark(in_quotes(agile) + " --ensemble 1", out), 2, {"--ensemble"});
  expect_one_line(benchmark(in_quotes(agile) + " --ensemble 2 --repeat 2", out), 2, {"--repeat", "--ensemble"});
  write(scratch() / "bad.toml", "[estimator]\nkeyframes = 40\n");
  expect_one_line(benchmark(in_quotes(agile) + " --config " + in_quotes(scratch() / "bad.toml"), out), 2,
                  {"bad.toml:2: "});
}

TEST_F(Benchmark, ReplacesNothingButAnEarlierBenchmark) {
  for (const char* mine : {"benchmark.txt", "runs/agile/track/1/stats.json"}) {
    write(out / mine, "mine");
    expect_one_line(benchmark(in_quotes(agile), out), 2, {"out/"});
    EXPECT_EQ(read(out / mine), "mine");
    fs::remove_all(out);
  }
  write(out / "notes.txt", "mine");
  for (int time = 0; time < 2; ++time) EXPECT_EQ(benchmark(in_quotes(agile), out).exit_code, 0);
  EXPECT_EQ(read(out / "notes.txt"), "mine");
}

TEST_F(Benchmark, PublishedFiguresStandBesideOursForWholeFlightsOnly) {
  // a program whose replays have the figures that lie beside the data set
  const fs::path program = scratch() / "program";
  write(program, "#!/bin/sh\ncp \"$2/stats.json\" \"$6/\" && touch \"$6/trajectory.tum\"\n");
  fs::permissions(program, fs::perms::owner_all);
  const auto stats_of = [&](const std::string& name, double ate_m) {
    write(scratch() / "rooms" / name / "stats.json",
          R"({"initialisation": {"done": true}, "dataset": {"has_ground_truth": true},
              "program": {"version": "", "commit": "", "build_type": "", "simd": ""},
              "error": {"ate_4dof_m": {"rmse": )" +
              std::to_string(ate_m) + "}}}");
    return in_quotes(scratch() / "rooms" / name);
  };
  const auto table_of = [&](const std::string& first, const std::string& second) {
    return run("--program " + in_quotes(program) + " --factors track --out " + in_quotes(out) + " " +
                   stats_of(first, 0.025) + " " + stats_of(second, 0.05),
               kScript + " --program ")
        .out;
  };
  const std::string both = table_of("room1", "room2");
  for (const char* row :
       {"room1     0.0250                    –  0.051      0.067    0.09       –  11.56         20.19\n",
        "mean      0.0375                    –  0.077      0.068    0.08       –  12.07         21.43\n"})
    EXPECT_NE(both.find(row), std::string::npos) << row << both;
  // the mean is of other flights than theirs
  const std::string one = table_of("room1", "mine");
  EXPECT_NE(one.find("mean      0.0375                    –      –          –       –       –      –             –\n"),
            std::string::npos)
      << one;
}

TEST_F(Benchmark, FiguresOfAnEarlierBenchmarkDoNotComeBack) {
  ASSERT_EQ(benchmark(in_quotes(agile), out).exit_code, 0);
  fs::remove(agile / "mav0/imu0/data.csv");
  EXPECT_EQ(benchmark(in_quotes(agile), out).exit_code, 1);
  EXPECT_TRUE(json(out)["runs"][0]["stats"].is_null());
  EXPECT_FALSE(fs::exists(out / "runs/agile/track/1/stats.json"));
}

/// Processes whose command line holds the text.
int processes_with(const std::string& text) {
  int count = 0;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator("/proc", ignored)) {
    const std::string line = read(entry.path() / "cmdline");
    count += line.find("replay") != std::string::npos && line.find(text) != std::string::npos;
  }
  return count;
}

/// Starts the program; its standard error goes to a file.
pid_t start(std::vector<std::string> arguments, const fs::path& err) {
  const pid_t child = fork();
  if (child != 0) return child;
  std::vector<char*> words;
  for (std::string& a : arguments) words.push_back(a.data());
  words.push_back(nullptr);
  if (std::freopen(err.c_str(), "w", stderr) != nullptr) execv(kScript.c_str(), words.data());
  _exit(127);
}

TEST_F(Benchmark, InterruptedItLeavesNoChildren) {
  const fs::path err = scratch() / "interrupted";
  const pid_t child = start(
      {"benchmark", "--program", EPILINE_PROGRAM, agile.string(), "--repeat", "5000", "--out", out.string()}, err);
  ASSERT_GT(child, 0);
  for (int i = 0; i < 12000 && !fs::exists(out / "runs/agile/track/2"); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  // to the benchmark alone, which has to pass it on
  ASSERT_EQ(kill(child, SIGINT), 0);
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 1);
  EXPECT_NE(read(err).find("epiline: error: interrupted after "), std::string::npos) << read(err);
  EXPECT_EQ(processes_with(out.string()), 0);
  EXPECT_FALSE(fs::exists(out / "benchmark.json"));
}

}  // namespace
}  // namespace epiline
