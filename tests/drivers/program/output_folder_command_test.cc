// Nothing of a user's is deleted or replaced without being asked, by any command that writes; and what cannot be
// written is said.
#include "tests/drivers/program/program.h"

namespace epiline {
namespace {

/// A command up to its --out, and the names of some of its results.
struct Writer {
  const char* command;
  std::vector<const char*> results;
};
const std::vector<Writer> kWriters = {
    {"simulate --tracks --flight hall --duration 9", {"mav0/cam0/data.csv", "mav0/notes.txt", "mav0/cam1/1.png"}},
    {"simulate --from RECORDING --duration 1", {"mav0/imu0/data.csv", "fit.json"}},
    {"replay RECORDING --quiet", {"trajectory.tum", "odometry.csv", "stats.json", "report.html", "events.txt"}},
    {"replay RECORDING --realtime --imu-rate", {"odometry_imu_rate.tum"}},
    {"hil RECORDING --config CONFIG", {"verdict.txt", "truth.tum", "stats.json"}},
    {"calibrate RECORDING", {"camera.yaml", "imu.yaml", "calibration.json", "report.html"}},
    {"record --config CONFIG", {"mav0/imu0/data.csv", "mav0/cam0/data.csv"}},
};

class OutputOfCommands : public CommandTest {
 protected:
  void SetUp() override {
    CommandTest::SetUp();
    write(config_, "[camera]\ndevice = \"/dev/null\"\n[imu]\ndevice = \"no-such-imu\"\n");
  }
  Outcome run_into(std::string command, const fs::path& out, const std::string& more = "") const {
    const auto put = [&](const std::string& word, const fs::path& path) {
      const std::size_t at = command.find(word);
      if (at != std::string::npos) command.replace(at, word.size(), path.string());
    };
    put("RECORDING", scratch() / "recording");
    put("CONFIG", config_);
    return run(command + " --out " + in_quotes(out) + " " + more);
  }
  fs::path config_ = scratch() / "config.toml";
};

TEST_F(OutputOfCommands, IsRefusedWhereSomethingElseIs) {
  for (const Writer& writer : kWriters) {
    for (const char* result : writer.results) {
      const fs::path out = scratch() / "out", mine = out / result;
      write(mine, "mine");
      SCOPED_TRACE(std::string(writer.command) + " " + result);
      expect_one_line(run_into(writer.command, out), 2, {"out/"});
      EXPECT_EQ(read(mine), "mine");
      EXPECT_EQ(std::distance(fs::directory_iterator(out), {}), 1);
      fs::remove_all(out);
    }
  }
}

TEST_F(OutputOfCommands, IsRefusedAtOnceWhereNoFolderCanBe) {
  write(scratch() / "file", "mine");
  for (const Writer& writer : kWriters) {
    SCOPED_TRACE(writer.command);
    for (const char* out : {"file", "file/below", "/proc/none"}) {
      const fs::path path = *out == '/' ? fs::path(out) : scratch() / out;
      expect_one_line(run_into(writer.command, path), 2, {path.string()});
    }
    EXPECT_EQ(read(scratch() / "file"), "mine");
  }
}

TEST_F(OutputOfCommands, OfABoardIsRefusedInPlaceOfACorrectedDescription) {
  const fs::path out = scratch() / "new/board.pdf", description = scratch() / "new/board.yaml";
  ASSERT_EQ(run_into("board", out).exit_code, 0);
  ASSERT_EQ(run_into("board --columns 5", out).exit_code, 0);  // its own
  write(description, read(description) + "# measured\n");
  const std::string mine = read(description);
  expect_one_line(run_into("board", out), 2, {"board.yaml", "--force"});
  EXPECT_EQ(read(description), mine);
  EXPECT_EQ(run_into("board", out, "--force").exit_code, 0);
  EXPECT_NE(read(description), mine);
}

TEST_F(OutputOfCommands, OfASimulationReplacesItsOwnAlone) {
  const fs::path out = scratch() / "out";
  const std::string simulate = "simulate --tracks --flight hall --duration 9";
  ASSERT_EQ(run_into(simulate, out).exit_code, 0);
  ASSERT_EQ(run_into(simulate + " --seed 2", out).exit_code, 0);
  write(out / "mav0/notes.txt", "mine");
  expect_one_line(run_into(simulate, out), 2, {"mav0/notes.txt", "--force"});
  expect_one_line(run_into("simulate --from " + out.string() + " --duration 1", out), 2, {"mav0/notes.txt"});
  EXPECT_EQ(read(out / "mav0/notes.txt"), "mine");
  EXPECT_TRUE(fs::exists(out / "mav0/cam0/tracks.csv"));
}

TEST_F(OutputOfCommands, OfAFlightIsKeptBesideWithANumber) {
  const fs::path out = scratch() / "out";
  write(out / "trajectory.tum", "mine");
  write(out / "trajectory.tum.1", "mine, too");
  write(scratch() / "camera.yaml",
        "T_BS: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\nresolution: [640, 480]\ncamera_model: pinhole\n"
        "intrinsics: [400, 400, 320, 240]\ndistortion_model: none\n");
  write(config_, "[camera]\ndevice = \"/dev/video77\"\ncalibration = \"" + (scratch() / "camera.yaml").string() +
                     "\"\n[imu]\ndevice = \"/sys/bus/iio/devices/iio:device77\"\n");
  EXPECT_NE(run_into("run --config CONFIG --no-wait", out).exit_code, 0);
  EXPECT_EQ(read(out / "trajectory.tum.1"), "mine, too");
  EXPECT_EQ(read(out / "trajectory.tum.2"), "mine");
}

TEST_F(OutputOfCommands, ThatDoesNotArriveIsAFailure) {
  std::string poses;
  for (int i = 0; i < 100; ++i) poses += std::to_string(i) + " " + std::to_string(0.1 * i) + " 0 0 0 0 0 1\n";
  write(scratch() / "a.tum", poses);
  const std::string a = (scratch() / "a.tum").string();
  for (const std::string& command : {"evaluate " + a + " " + a + " --json", "evaluate " + a + " " + a,
                                     std::string("config --print-defaults"), std::string("dbc")}) {
    const Outcome r = run(command, "", " >/dev/full");
    EXPECT_EQ(r.exit_code, 1) << command;
    EXPECT_EQ(r.err.rfind("epiline: error: ", 0), 0U) << r.err;
  }
  EXPECT_EQ(run("evaluate a b", "", " 2>&-").exit_code, 2);
  EXPECT_EQ(run("evaluate a b --json", "", " >/dev/full 2>&-").exit_code, 2);
}

}  // namespace
}  // namespace epiline
