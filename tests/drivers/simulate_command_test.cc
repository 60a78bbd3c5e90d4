// `epiline simulate` as a user meets it: the folder it leaves, its errors, and what a replay makes of it.
#include "tests/drivers/program.h"

namespace epiline {
namespace {

class SimulateCommand : public testing::Test {
 protected:
  void SetUp() override { fs::remove_all(scratch()); }
  void TearDown() override { fs::remove_all(scratch()); }

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

// A disk that fills up is an error, and leaves nothing that looks like a flight. (A limit on file size stands for it.)
TEST_F(SimulateCommand, LeavesNothingWhenTheDiskIsFull) {
  expect_one_line(run("simulate --flight hall --duration 1 --out " + in("x"), "trap '' XFSZ; ulimit -f 60; "), 2,
                  {"x/mav0"});
  EXPECT_FALSE(fs::exists(scratch() / "x/mav0"));
  EXPECT_FALSE(fs::exists(scratch() / "x/mav0.partial"));
}

}  // namespace
}  // namespace epiline
