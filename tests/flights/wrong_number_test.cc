// Numbers of the user that are wrong, on a recorded flight: what is flown well all the same, and what is named. The
// whole table: tests/flights/wrong_numbers.cc, docs/developers/decisions.md#wrong-numbers.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>

#include "tests/flights/wrong_number_run.h"
#include "tests/support/recorded_data.h"

namespace epiline {
namespace {

class WrongNumbers : public ::testing::Test {
 protected:
  void SetUp() override {
    options_.dataset = test::recorded_data("euroc_MH_01");
    options_.duration_s = 12;
    if (!std::filesystem::exists(options_.dataset)) GTEST_SKIP() << options_.dataset << " is not there";
  }
  test::WrongNumberVerdict fly(const std::string& name) const {
    const auto& all = test::wrong_numbers();
    const auto found = std::find_if(all.begin(), all.end(), [&](const auto& w) { return w.name == name; });
    EXPECT_NE(found, all.end()) << name;
    return found == all.end() ? test::WrongNumberVerdict{} : test::fly_with_wrong_number(options_, *found);
  }
  static bool named(const test::WrongNumberVerdict& v, const std::string& words) {
    return std::any_of(v.suspects.begin(), v.suspects.end(),
                       [&](const std::string& s) { return s.find(words) != std::string::npos; });
  }

  ReplayOptions options_;
};

TEST_F(WrongNumbers, RightOnesAreNotSuspected) {
  const auto v = fly("nothing");
  ASSERT_TRUE(v.ran);
  EXPECT_TRUE(v.suspects.empty()) << v.suspects.front();
  EXPECT_EQ(v.wrong_share, 0);
}

/// It is set down half a second later, then handled on the ground.
TEST_F(WrongNumbers, RightOnesAreNotSuspectedWhereItHardlyMoves) {
  options_.start_s = 15;
  options_.duration_s = 14;
  const auto v = fly("nothing");
  ASSERT_TRUE(v.ran);
  EXPECT_TRUE(v.suspects.empty()) << v.suspects.front();
}

TEST_F(WrongNumbers, MountingAndDensitiesAreCorrectedInFlight) {
  const double right = fly("nothing").ate_m;
  for (const char* name : {"camera turned 5 deg about z", "lever arm + 0.05 m in x", "densities x 0.01"}) {
    const auto v = fly(name);
    ASSERT_GT(v.ate_m, 0) << name;
    EXPECT_LT(v.ate_m, 1.5 * right) << name;
    EXPECT_EQ(v.wrong_share, 0) << name;
  }
}

TEST_F(WrongNumbers, GrossOnesAreNamedAndNotFlown) {
  const std::pair<const char*, const char*> cases[] = {{"T_cam_imu inverted", "is inverted"},
                                                       {"accelerometer in g", "in g?"},
                                                       {"gyroscope in degrees", "in degrees"},
                                                       {"axes x and y swapped", "swapped"}};
  for (const auto& [name, words] : cases) {
    const auto v = fly(name);
    EXPECT_TRUE(named(v, words)) << name;
    EXPECT_EQ(v.wrong_share, 0) << name;
  }
}

/// The contradiction shows in motion only, and leads to new starts, at rest too. None of them may be called good.
TEST_F(WrongNumbers, AContradictionOutlivesNewStarts) {
  options_.duration_s = 30;
  const auto v = fly("sign of accelerometer's x");
  EXPECT_TRUE(named(v, "contradict"));
  EXPECT_GT(v.resets, 0U);
  EXPECT_EQ(v.wrong_share, 0) << v.worst_ratio << " sigma";
}

/// A fifth of the radius at 45 degrees: far beyond what is linear, so the flight is not called good, but goes on.
TEST_F(WrongNumbers, ADistortionThatIsMissingIsFound) {
  options_.duration_s = 30;
  const auto v = fly("no distortion");
  EXPECT_TRUE(named(v, "its distortion is wrong"));
  EXPECT_EQ(v.resets, 0U);
  EXPECT_EQ(v.wrong_share, 0) << v.worst_ratio << " sigma";
  EXPECT_LT(v.ate_m, 0.02);
}

TEST_F(WrongNumbers, ScalesOfTheImuAreCorrectedInFlight) {
  const double right = fly("nothing").ate_m;
  for (const char* name : {"gyroscope + 3 %", "accelerometer + 3 %"}) {
    const auto v = fly(name);
    ASSERT_GT(v.ate_m, 0) << name;
    EXPECT_LT(v.ate_m, 1.5 * right) << name;
    EXPECT_EQ(v.wrong_share, 0) << name;
    EXPECT_TRUE(named(v, "scale is wrong")) << name;
  }
}

}  // namespace
}  // namespace epiline
