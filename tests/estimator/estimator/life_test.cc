// The table of flights with what life has: no more rows fail than are known to, and none should.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <initializer_list>
#include <iostream>
#include <set>
#include <string>
#include <tuple>

#include "platform/log/suspicion_names.h"
#include "tests/estimator/estimator/life.h"

namespace epiline::test {
namespace {

/// `./run test nightly` sets it.
bool is_nightly() { return std::getenv("EPILINE_NIGHTLY") != nullptr; }

std::string told(const Row& row, unsigned seed, const LifeVerdict& verdict, bool smaller) {
  std::string text = "row " + std::to_string(seed) + ": " + to_string(row) + "\n  " + to_string(verdict);
  if (!smaller) return text;
  const Row small = smallest(row, seed, verdict);
  return text + "\n  smallest: " + to_string(small) + "\n  " + to_string(fly(small, seed));
}

/// Of the tables of these seeds the rows that fail, `most` of which may; in the night, with the smallest row that fails
/// alike. A row's seed is its number.
void fly_tables(unsigned tables, std::size_t every, int most) {
  int rows = 0, red = 0;
  std::string failures;
  double cpu_s = 0;
  for (unsigned table = 1; table <= tables; ++table) {
    const std::vector<Row> all = pairwise_table(table);
    for (std::size_t i = 0; i < all.size(); i += every) {
      const auto seed = static_cast<unsigned>(1000 * table + i);
      const LifeVerdict verdict = fly(all[i], seed);
      ++rows;
      cpu_s += verdict.cpu_s;
      if (verdict.passes()) continue;
      ++red;
      failures += told(all[i], seed, verdict, is_nightly()) + "\n";
    }
  }
  EXPECT_LE(red, most) << failures;
  std::cout << red << " of " << rows << " rows fail, " << cpu_s << " s of CPU\n";
}

/// 6 of 207 fail, 138 before the window kept its last frames. None should; the number may only
/// fall, and differs by a few between processors.
TEST(EstimatorLife, NoMoreRowsOfTheTableFail) {
#if defined(EPILINE_SANITIZED) || !defined(__x86_64__)  // that are slow, or emulated
  fly_tables(1, 10, 8);
#else
  fly_tables(1, 1, 8);
#endif
}

TEST(EstimatorLife, NoRowOfTheNightsTablesFails) {
  if (!is_nightly()) GTEST_SKIP() << "minutes: for the night (EPILINE_NIGHTLY)";
  fly_tables(5, 1, 0);
}

/// What a switch does alone, which pairs hide: six flights of each path and wait with one. 39 of 3132 fail; the number
/// may only fall, and differs by a few between processors.
TEST(EstimatorLife, NoMoreFlightsWithOneSwitchFail) {
  if (!is_nightly()) GTEST_SKIP() << "minutes: for the night (EPILINE_NIGHTLY)";
  constexpr int kFlights = 6, kKnown = 41;
  int red = 0;
  std::string failures;
  for (const Row& row : single_table()) {
    int failed = 0;
    std::string last;
    for (unsigned seed = 101; seed < 101 + kFlights; ++seed) {
      const LifeVerdict verdict = fly(row, seed);
      if (verdict.passes()) continue;
      ++failed;
      last = std::to_string(seed) + ": " + to_string(verdict);
    }
    red += failed;
    if (failed > 0) failures += std::to_string(failed) + " of 6: " + to_string(row) + " | seed " + last + "\n";
  }
  std::cout << failures << red << " flights with one switch fail\n";
  EXPECT_LE(red, kKnown);
}

/// EPILINE_ROW=1017: that row, with the smallest one that fails alike.
TEST(EstimatorLife, ARowOfChoice) {
  const char* row = std::getenv("EPILINE_ROW");
  if (row == nullptr) GTEST_SKIP() << "no row was chosen (EPILINE_ROW)";
  const auto seed = static_cast<unsigned>(std::atoi(row));
  const Row chosen = pairwise_table(seed / 1000).at(seed % 1000);
  const LifeVerdict verdict = fly(chosen, seed);
  EXPECT_TRUE(verdict.passes()) << told(chosen, seed, verdict, true);
}

Row with(Path path, View view) {
  Row row{};
  row[kPath] = path;
  row[kView] = view;
  return row;
}

void expect_passes(std::initializer_list<Path> paths, View view, std::uint64_t most_resets = 0) {
  for (const Path path : paths)
    for (const unsigned seed : {1U, 2U, 3U, 4U}) {
      const Row row = with(path, view);
      const LifeVerdict verdict = fly(row, seed);
      EXPECT_TRUE(verdict.passes()) << told(row, seed, verdict, false);
      EXPECT_LE(verdict.resets, most_resets) << told(row, seed, verdict, false);
    }
}

// A lens that is covered while it waits costs no start: what was known goes on, and is worth what its covariance says.
TEST(EstimatorLife, StandsThroughASilenceOfTheCamera) {
  for (const Mishap silence : {kCameraShort, kCameraLong})
    for (const unsigned seed : {101U, 102U, 103U, 104U, 105U, 106U}) {
      Row row = with(kStand, kClean);
      row[kWait] = kLongWait;
      row[kEvent] = silence;
      const LifeVerdict verdict = fly(row, seed);
      EXPECT_TRUE(verdict.passes()) << told(row, seed, verdict, false);
      EXPECT_GT(verdict.tracking_share, 0.95) << told(row, seed, verdict, false);
    }
}

/// The worse of both, if it tracks.
void keep_worse(const LifeRig& rig, LifeError& worst) {
  if (rig.estimator().odometry().health.state != HealthState::kTracking) return;
  if (const LifeError now = worst_error(rig); now.sigmas > worst.sigmas) worst = now;
}

// A silence of the camera takes nothing from what the flight will find: a number that is wrong is found as if there had
// been none, and what it did meanwhile to place and heading is mended then.
TEST(EstimatorLife, FindsAWrongNumberAfterASilence) {
  for (const Number number : {kFocalOff, kLeverOff, kTurned, kRateScale})
    for (const Mishap silence : {kCameraShort, kCameraLong})
      for (const unsigned seed : {1U, 5U, 8U, 9U}) {
        Row row = with(kRoom, kClean);
        row[kWait] = kLongWait;
        row[kNumber] = number;
        row[kEvent] = silence;
        const LifeVerdict verdict = fly(row, seed);
        EXPECT_TRUE(verdict.passes()) << told(row, seed, verdict, false);
      }
}

// A lens that was never calibrated, or another one: its distortion is found, and named where it is worth a word.
TEST(EstimatorLife, FindsADistortionThatIsNotAsConfigured) {
  for (const double distortion : {-0.05, -0.01, 0.01, 0.05})
    for (const Path path : {kRoom, kDash, kTurn})
      for (const unsigned seed : {1U, 2U}) {
        LifeRig rig(with(path, kClean), seed);
        rig.distortion = distortion;
        LifeError worst;
        rig.run_to(rig.ends_at(), [&](const StepResult& result) {
          if (result.has_pose) keep_worse(rig, worst);
        });
        EXPECT_LT(worst.sigmas, LifeVerdict::kSigmas)
            << distortion << ' ' << path << ' ' << seed << ' ' << worst.what << ' ' << worst.error;
        const EstimatorStats& found = rig.estimator().stats();
        EXPECT_NEAR(found.calibration.lens_edge_ratio, 1 + distortion, 0.01) << path << ' ' << seed;
        for (std::size_t i = 0; i < found.suspicions.size(); ++i) {
          const bool worth_a_word = static_cast<Suspect>(i) == Suspect::kLensShape && std::abs(distortion) > 0.015;
          EXPECT_EQ(found.suspicions[i].severity, worth_a_word ? Severity::kNote : Severity::kNone)
              << distortion << ' ' << path << ' ' << seed << ' ' << kSuspectNames[i];
        }
      }
}

// What it sees is far away, and shows late that it moves; what it read since its camera came back shows that at once.
TEST(EstimatorLife, LeavesAsSoonAsItsCameraIsBack) {
  for (const unsigned seed : {1U, 2U, 3U, 4U}) {
    Row row = with(kCruise, kClean);
    row[kWait] = kLongWait;
    LifeRig rig(row, seed);
    rig.blind = {11.3, 12};
    rig.run_to(15, [&](const StepResult& result) {
      if (rig.now() < 12 || !result.has_pose) return;
      const LifeError e = worst_error(rig);
      EXPECT_LT(e.sigmas, LifeVerdict::kSigmas) << seed << ": " << e.what << ' ' << e.error << " at " << rig.now();
    });
  }
}

// Most of what is seen may move by itself: it neither moves the vehicle nor accuses a number.
TEST(EstimatorLife, ALorryThatFillsTheViewIsNoWrongNumber) { expect_passes({kHover, kDash, kTurn, kRoad}, kLorry); }

// The images stand still, and the readings say that it leaves: it is neither trusted with a speed nor lost for long.
TEST(EstimatorLife, StandsInALift) { expect_passes({kStand}, kLift, 2); }

// What it sees is what it flies in: the forces of the room's motion are doubted, and the way in the room goes on.
TEST(EstimatorLife, FliesOnInALift) { expect_passes({kRoom, kDash, kHover}, kLift); }

// A bonnet in view stays in the image: neither the start in motion nor the rest detector believes it.
TEST(EstimatorLife, OwnPartsTellNothingOfTheRoad) {
  for (const Wait wait : {kShortWait, kInMotion})
    for (const unsigned seed : {101U, 102U, 103U, 104U, 105U, 106U}) {
      Row row = with(kRoad, kOwnParts);
      row[kWait] = wait;
      const LifeVerdict verdict = fly(row, seed);
      EXPECT_EQ(verdict.wrong, 0) << told(row, seed, verdict, false);
      EXPECT_EQ(verdict.resets, 0U) << told(row, seed, verdict, false);
      EXPECT_TRUE(verdict.innocent.empty()) << told(row, seed, verdict, false);
    }
}

/// Poses while `tracking`.
int wrong_until_the_end(LifeRig& rig) {
  int wrong = 0;
  rig.run_to(rig.ends_at(), [&](const StepResult& result) {
    if (!result.has_pose || rig.estimator().odometry().health.state != HealthState::kTracking) return;
    wrong += rig.now() > 5 && worst_error(rig).sigmas > LifeVerdict::kSigmas;
  });
  return wrong;
}

// A chip may start anew, or be hit: from then on its bias is another one, which turns nothing.
TEST(EstimatorLife, AGyroscopesBiasThatStepsInFlightCostsNoAttitude) {
  for (const Path path : {kRoom, kHover, kDash, kTurn, kCruise})
    for (const unsigned seed : {1U, 2U}) {
      LifeRig rig(with(path, kClean), seed);
      rig.bias_step = Vec3(0.02, -0.03, 0.05);
      rig.bias_steps_at_s = 11;
      LifeError worst;
      rig.run_to(rig.ends_at(), [&](const StepResult& result) {
        if (result.has_pose && rig.now() > 5) keep_worse(rig, worst);
      });
      EXPECT_LT(worst.sigmas, LifeVerdict::kSigmas) << path << ' ' << seed << ' ' << worst.what << ' ' << worst.error;
      EXPECT_EQ(rig.estimator().stats().resets, 0U) << path << ' ' << seed;
      EXPECT_EQ(rig.estimator().odometry().health.state, HealthState::kTracking) << path << ' ' << seed;
    }
}

// Larger steps, and those in a lively flight, are wrong for longer.
TEST(EstimatorLife, AnAccelerometersBiasThatStepsInFlightIsFollowed) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    LifeRig rig(with(kRoom, kClean), seed);
    rig.force_step = Vec3(0, -0.3, 0);
    rig.bias_steps_at_s = 11;
    EXPECT_LE(wrong_until_the_end(rig), 3) << seed;
    EXPECT_EQ(rig.estimator().stats().resets, 0U) << seed;
    EXPECT_EQ(rig.estimator().odometry().health.state, HealthState::kTracking) << seed;
  }
}

// A driver that loses a frame's buffer: from then on each image has the stamp of the one before.
TEST(EstimatorLife, StampsThatSlipByAFrameInFlightAreFollowed) {
  for (const Path path : {kRoom, kDash, kTurn})
    for (const unsigned seed : {1U, 2U, 3U}) {
      LifeRig rig(with(path, kClean), seed);
      rig.stamps_step_s = -0.05;
      rig.stamps_step_at_s = 11;
      EXPECT_EQ(wrong_until_the_end(rig), 0) << path << ' ' << seed;
      EXPECT_EQ(rig.estimator().stats().resets, 0U) << path << ' ' << seed;
      EXPECT_EQ(rig.estimator().odometry().health.state, HealthState::kTracking) << path << ' ' << seed;
      EXPECT_NEAR(rig.estimator().odometry().time_offset_s, 0.05, 0.005) << path << ' ' << seed;
    }
}

// After a hard landing both sensors ring: they read nonsense, of which only the images know.
TEST(EstimatorLife, ReadingsThatAreNonsenseForAMomentMoveNothing) {
  for (const Path path : {kHover, kRoom, kDash, kTurn, kRoad})
    for (const unsigned seed : {1U, 2U, 3U}) {
      LifeRig rig(with(path, kClean), seed);
      rig.rings = {11.02, 11.12};
      Vec3 p0 = Vec3::Zero(), q0 = Vec3::Zero();
      double off_m = 0, back_at_s = 0;
      LifeError worst;
      rig.run_to(rig.ends_at(), [&](const StepResult& result) {
        if (!result.has_pose || rig.now() < 10) return;
        const Odometry& o = rig.estimator().odometry();
        const Vec3 p(o.p_WB_m.data()), q = rig.motion.p(rig.now());
        if (rig.now() < 11) p0 = p, q0 = q;
        off_m = std::max(off_m, std::abs((p - p0).norm() - (q - q0).norm()));
        if (o.health.state != HealthState::kTracking) back_at_s = rig.now();
        keep_worse(rig, worst);
      });
      EXPECT_LT(worst.sigmas, LifeVerdict::kSigmas) << path << ' ' << seed << ' ' << worst.what << ' ' << worst.error;
      EXPECT_LT(back_at_s, 14) << path << ' ' << seed << ' ' << rig.estimator().odometry().health.reasons;
      EXPECT_LT(off_m, path == kRoad ? 1.5 : 0.15) << path << ' ' << seed;
      EXPECT_EQ(rig.estimator().stats().resets, 0U) << path << ' ' << seed;
    }
}

// What a hatch that is slammed does to a vehicle that stands: its images know that it has gone nowhere, though it has
// not moved yet, and no depth is known.
TEST(EstimatorLife, ABlowMovesNothingThatStands) {
  struct Stand {
    bool has_flown;
    Vibration vibration;
  };
  for (const auto& [has_flown, vibration] : {Stand{false, kSmooth}, Stand{true, kSmooth}, Stand{false, kAlways}})
    for (const Path path : {kRoom, kDash, kTurn})
      for (const unsigned seed : {1U, 2U, 3U, 4U}) {
        Row row = with(path, kClean);
        row[kVibration] = vibration;
        LifeRig rig(row, seed, true);
        if (has_flown) rig.motion.change(4);
        if (has_flown) rig.motion.change(9);
        rig.motion.change(22);
        rig.rings = {14.02, 14.12};
        Vec3 stood = Vec3::Zero();
        double off_m = 0, back_at_s = 0;
        LifeError worst;
        rig.run_to(26, [&](const StepResult& result) {
          if (!result.has_pose || rig.now() < 12) return;
          const Odometry& o = rig.estimator().odometry();
          const Vec3 p(o.p_WB_m.data());
          if (rig.now() < 14) stood = p;
          if (rig.now() < 22) off_m = std::max(off_m, (p - stood).norm());
          if (rig.now() < 22 && o.health.state != HealthState::kTracking) back_at_s = rig.now();
          keep_worse(rig, worst);
        });
        EXPECT_LT(worst.sigmas, LifeVerdict::kSigmas) << path << ' ' << seed << ' ' << worst.what << ' ' << worst.error;
        EXPECT_LT(vibration == kSmooth ? back_at_s : 0, 16)
            << path << ' ' << seed << ' ' << rig.estimator().odometry().health.reasons;
        EXPECT_LT(off_m, 0.3) << has_flown << ' ' << path << ' ' << seed;
        EXPECT_EQ(rig.estimator().stats().resets, 0U) << path << ' ' << seed;
      }
}

// A person walks beside it: a start in motion could take that for its own speed, and the room for far away.
TEST(EstimatorLife, AHoverThatBeginsBesideAPersonDoesNotWalkAway) {
  for (const View view : {kPerson, kLorry})
    for (const unsigned seed : {101U, 102U, 103U, 104U, 105U, 106U}) {
      Row row = with(kHover, view);
      row[kWait] = kInMotion;
      const LifeVerdict verdict = fly(row, seed);
      EXPECT_EQ(verdict.wrong, 0) << told(row, seed, verdict, false);
    }
}

// What the table promises.
TEST(EstimatorLifeTable, HasEveryPairOfValuesAndAtMostTwoFaultsInARow) {
  const std::vector<Row> table = pairwise_table(1);
  EXPECT_EQ(table, pairwise_table(1));
  std::set<std::tuple<std::size_t, int, std::size_t, int>> pairs;
  for (const Row& row : table) {
    EXPECT_LE(std::count_if(row.begin() + kNumber, row.begin() + kImages + 1, [](int v) { return v > 0; }), 2);
    for (std::size_t a = 0; a < kSwitches; ++a)
      for (std::size_t b = a + 1; b < kSwitches; ++b) pairs.insert({a, row[a], b, row[b]});
  }
  std::size_t possible = 0;
  for (std::size_t a = 0; a < kSwitches; ++a)
    for (std::size_t b = a + 1; b < kSwitches; ++b)
      possible += switch_names()[a].values.size() * switch_names()[b].values.size();
  EXPECT_EQ(pairs.size(), possible - 6) << "no fast path in a lift, and no start in a hover or before a lorry";
}

// The judge must see what is wrong, and the harmless row must pass.
TEST(EstimatorLifeTable, TheHarmlessRowPassesWithRoomToSpare) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    const LifeVerdict verdict = fly(Row{}, seed);
    EXPECT_TRUE(verdict.passes()) << to_string(verdict);
    EXPECT_GT(verdict.worst, 0.2);
    EXPECT_LT(verdict.worst, 2);
    EXPECT_GT(verdict.judged, 300);
  }
}

}  // namespace
}  // namespace epiline::test
