#pragma once
// The program as a user meets it, for tests: run, exit code, stdout and stderr, files.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace epiline {

namespace fs = std::filesystem;
using Json = nlohmann::json;

struct Outcome {
  int exit_code = -1;
  std::string out, err;
};

inline std::string read(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}
inline void write(const fs::path& path, const std::string& text) {
  fs::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary) << text;
}

/// A folder of its own for each test.
inline fs::path scratch() {
  const auto* test = testing::UnitTest::GetInstance()->current_test_info();
  std::string name = std::string("epiline_") + test->test_suite_name() + "_" + test->name();
  for (char& c : name) c = c == '/' ? '_' : c;
  return fs::path(testing::TempDir()) / name;
}

/// A path as a word of a command.
inline std::string in_quotes(const fs::path& path) { return "'" + path.string() + "'"; }

/// The program that has this command, or option.
inline std::string program_of(const std::string& arguments) {
  const bool of_study = arguments.rfind("simulate", 0) == 0 || arguments.find("--visual-factor") != std::string::npos;
  return of_study ? EPILINE_STUDY : EPILINE_PROGRAM;
}

/// `before`: shell words in front of the program, for instance to limit it; `after`: behind it.
inline Outcome run(const std::string& arguments, const std::string& before = "", const std::string& after = "") {
  const fs::path out = scratch() / "stdout", err = scratch() / "stderr";
  fs::create_directories(scratch());
  const std::string command =
      before + program_of(arguments) + " " + arguments + " >" + in_quotes(out) + " 2>" + in_quotes(err) + after;
  const int status = std::system(command.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read(out), read(err)};
}

inline void expect_one_line(const Outcome& r, int exit_code, const std::vector<std::string>& parts) {
  EXPECT_EQ(r.exit_code, exit_code) << r.err;
  EXPECT_EQ(r.err.rfind("epiline: error: ", 0), 0u) << r.err;
  EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << r.err;
  EXPECT_NE(r.err.find("; expected "), std::string::npos) << r.err;
  for (const std::string& part : parts) EXPECT_NE(r.err.find(part), std::string::npos) << part << " not in " << r.err;
}

/// The sections of a configuration whose devices are on no computer.
inline constexpr const char* kAbsentDevices =
    "[camera]\ndevice = \"/dev/video77\"\n[imu]\ndevice = \"/sys/bus/iio/devices/iio:device77\"\n";
/// Keeps real time whatever the computer does: nothing that is late is left out.
inline constexpr const char* kPatient = "[realtime]\nimu_wait_ms = 5000\ndeadline_ms = 0\n";

/// The sections of a configuration that has the calibration of a folder's camera and IMU, or of another IMU.
inline std::string calibrated_by(const fs::path& flight, const fs::path& imu = {}) {
  return "[camera]\ncalibration = \"" + (flight / "mav0/cam0/sensor.yaml").string() + "\"\n[imu]\ncalibration = \"" +
         (imu.empty() ? flight / "mav0/imu0/sensor.yaml" : imu).string() + "\"\n";
}

/// The flight's threads called neither heap nor lock and, if memory is locked, met no new page.
inline void expect_quiet_threads([[maybe_unused]] const Json& stats) {
#ifndef EPILINE_SANITIZED  // sanitizers stand where the counters would, and touch pages of their own
  for (const auto& [name, thread] : stats["realtime"]["threads"].items()) {
    EXPECT_EQ(thread["heap_allocations"], 0) << name;
    EXPECT_EQ(thread["lock_calls"], 0) << name;
    if (stats["realtime"]["memory_locked"]) {
      EXPECT_EQ(thread["page_faults"], 0) << name;
    }
  }
#endif
}

/// Tests in a folder of their own, which is gone before and after each.
class CommandTest : public testing::Test {
 protected:
  void SetUp() override { fs::remove_all(scratch()); }
  void TearDown() override { fs::remove_all(scratch()); }
  /// Writes a configuration; returns the option that names it.
  static std::string with_config(const std::string& text, const fs::path& file = scratch() / "flight.toml") {
    write(file, text);
    return " --config " + in_quotes(file) + " ";
  }
};

/// Tests over a rendered flight of 5 s, made once for all of a suite; several processes may run at once.
class OverARenderedFlight : public CommandTest {
 protected:
  static void SetUpTestSuite() {
    flight_ = fs::path(testing::TempDir()) / ("epiline_rendered_flight_" + std::to_string(getpid()));
    fs::remove_all(flight_);
    const std::string simulate = std::string(EPILINE_STUDY) + " simulate --flight agile --duration 5 --out ";
    ASSERT_EQ(std::system((simulate + in_quotes(flight_) + " >/dev/null 2>&1").c_str()), 0);
  }
  static void TearDownTestSuite() { fs::remove_all(flight_); }
  static Outcome replay(const std::string& name, const std::string& more) {
    return run("replay " + in_quotes(flight_) + " --out " + in_quotes(scratch() / name) + " " + more);
  }
  static Json stats(const std::string& name) { return Json::parse(read(scratch() / name / "stats.json")); }

  inline static fs::path flight_;
};

}  // namespace epiline
