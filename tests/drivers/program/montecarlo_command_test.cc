// The Monte-Carlo study as a user meets it. What its figures mean is tested in tests/flights/montecarlo_test.cc.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "tests/drivers/program/program.h"

namespace epiline {
namespace {

class MonteCarlo : public testing::Test {
 protected:
  void SetUp() override { fs::remove_all(scratch()); }
  Outcome study(const std::string& arguments, const std::string& folder = "out") {
    return run("montecarlo " + arguments + " --out '" + (scratch() / folder).string() + "'");
  }
  Json json(const std::string& folder = "out") { return Json::parse(read(scratch() / folder / "montecarlo.json")); }
};

TEST_F(MonteCarlo, WritesTablesAndFigures) {
  const Outcome r = study("--flight agile --factors track,epipolar:gate --runs 3 --seed 5");
  ASSERT_EQ(r.exit_code, 0) << r.err;
  EXPECT_EQ(read(scratch() / "out/montecarlo.txt"), r.out);
  for (const char* part : {"NEES position", "ATE, m", "epipolar:gate", "agile"})
    EXPECT_NE(r.out.find(part), std::string::npos) << part;
  const Json s = json();
  EXPECT_EQ(s["schema"], 1);
  EXPECT_EQ(s["settings"]["seed"], 5);
  ASSERT_EQ(s["results"].size(), 2u);
  for (const Json& cell : s["results"]) {
    EXPECT_EQ(cell["flight"], "agile");
    EXPECT_EQ(cell["diverged"], 0);
    ASSERT_EQ(cell["runs"].size(), 3u);
    EXPECT_EQ(cell["runs"][2]["seed"], 7);
    double squares = 0, nees = 0;
    for (const Json& one : cell["runs"]) {
      squares += std::pow(one["ate_m"].get<double>(), 2) / 3;
      nees += one["nees_position"].get<double>() / 3;
    }
    EXPECT_NEAR(cell["errors"]["ate_m"]["rms"], std::sqrt(squares), 1e-12);
    EXPECT_NEAR(cell["errors"]["nees_position"]["mean"], nees, 1e-12);
    EXPECT_GT(cell["timing_ms"]["solve"]["mean"], 0);
  }
}

/// All but the times.
Json figures(const Json& study) {
  Json list = Json::array();
  for (const Json& cell : study["results"]) list.push_back(cell["runs"]);
  return list;
}

TEST_F(MonteCarlo, FiguresDependOnSeedsNotOnThreads) {
  const std::string some = "--flight agile,corridor --factors track --runs 2 --jobs ";
  ASSERT_EQ(study(some + "1", "one").exit_code, 0);
  ASSERT_EQ(study(some + "2", "two").exit_code, 0);
  EXPECT_EQ(figures(json("one")), figures(json("two")));
  ASSERT_EQ(study("--flight agile --factors track --runs 1 --seed 2", "shifted").exit_code, 0);
  EXPECT_EQ(figures(json("shifted"))[0][0], figures(json("one"))[0][1]);
}

TEST_F(MonteCarlo, EachKindOfNoiseReachesTheTracks) {
  const std::string some = "--flight agile --factors track --runs 1 ";
  ASSERT_EQ(study(some + "--pixel-noise 0.3 --outliers 0", "plain").exit_code, 0);
  for (const std::string noise :
       {"--pixel-noise 0.6 --outliers 0", "--pixel-noise 0.3 --outliers 0.05",
        "--pixel-noise 0.3 --outliers 0 --drift 0.1", "--pixel-noise 0.3 --outliers 0 --correlated-noise 0.5"}) {
    ASSERT_EQ(study(some + noise, "noisy").exit_code, 0);
    EXPECT_NE(figures(json("noisy")), figures(json("plain"))) << noise;
  }
}

TEST_F(MonteCarlo, WrongUsageIsExitCodeTwo) {
  expect_one_line(study("--flight moon"), 2, {"moon"});
  expect_one_line(study("--factors guess"), 2, {"\"guess\"", "one of track, epipolar"});
  expect_one_line(study("--factors track:faster"), 2, {"\"faster\"", "steps=N"});
  expect_one_line(study("--runs 0"), 2, {"runs"});
  expect_one_line(run("montecarlo"), 2, {"--out"});
}

}  // namespace
}  // namespace epiline
