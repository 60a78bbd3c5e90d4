// The governor against a made-up computer: what a solve costs is a formula, so what fits is known.
#include "pipeline/stages/load_governor.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

namespace epiline {
namespace {

/// A window with so many tracks; a linearisation takes a fixed time and one for each track.
struct Computer {
  int tracks = 250;
  int linearisations = 1;  ///< of a solve with all its iterations: hardly ever more
  double fixed_ns = 50'000, track_ns = 500, once_ns = 50'000;

  std::int64_t cost(int used) const { return cost(used, linearisations); }
  std::int64_t cost(int used, int times) const {
    return static_cast<std::int64_t>(times * (fixed_ns + track_ns * used) + once_ns);
  }
};

class Flight {
 public:
  explicit Flight(const Computer& computer) : computer_(computer) {}

  /// One frame due to be solved, 0.1 s after the last; the time its solve took, 0: predicted.
  std::int64_t frame(std::int64_t budget_ns, bool saves = false) {
    stamp_ = stamp_ + Span::from_milliseconds(100);
    plan_ = governor_.plan(stamp_, budget_ns, saves);
    if (!plan_.effort.solve) return 0;
    const int used =
        plan_.effort.most_tracks > 0 ? std::min(plan_.effort.most_tracks, computer_.tracks) : computer_.tracks;
    const int linearisations = plan_.effort.most_steps == 1 ? 1 : computer_.linearisations;
    const std::int64_t ns = computer_.cost(used, linearisations) * stretch_;
    governor_.took(ns, computer_.tracks, used, linearisations);
    return ns;
  }
  void frames(int count, std::int64_t budget_ns) {
    for (int i = 0; i < count; ++i) frame(budget_ns);
  }
  LoadLevel level() const { return governor_.level(); }
  const LoadGovernor::Counts& counts() const { return governor_.counts(); }
  const LoadGovernor::Plan& plan() const { return plan_; }
  void stretch(int factor) { stretch_ = factor; }

 private:
  Computer computer_;
  LoadGovernor governor_;
  LoadGovernor::Plan plan_;
  HostStamp stamp_{1'000'000'000};
  int stretch_ = 1;
};

constexpr std::int64_t kFull = 225'000;  // ns, of a solve of 250 tracks: Computer{}.cost(250)
constexpr std::int64_t kShort = kFull * 7 / 10;

TEST(LoadGovernor, GivesNothingUpWhileThereIsTime) {
  Flight flight(Computer{});
  ASSERT_EQ(Computer{}.cost(250), kFull);
  flight.frames(50, LoadGovernor::kUnlimited);
  flight.frames(50, 2 * kFull);
  EXPECT_FALSE(flight.plan().effort.reduced());
  EXPECT_EQ(flight.counts().frames, (std::array<std::uint64_t, kLoadLevels>{100, 0, 0, 0}));
  EXPECT_EQ(flight.counts().lowered, 0u);
  EXPECT_EQ(flight.counts().over_budget, 0u);
}

TEST(LoadGovernor, LearnsHowOftenASolveLinearises) {
  for (const int linearisations : {1, 2}) {
    Computer computer;
    computer.linearisations = linearisations;
    const std::int64_t full = computer.cost(250);
    Flight flight(computer);
    flight.frames(50, full * 107 / 100);
    EXPECT_EQ(flight.counts().lowered, 0u) << linearisations;
    flight.frames(50, full * 98 / 100);
    EXPECT_EQ(flight.level(), LoadLevel::kFewerFeatures) << linearisations;
    EXPECT_EQ(flight.counts().over_budget, 0u) << linearisations;
  }
}

TEST(LoadGovernor, GivesUpFeaturesThenIterationsThenTheSolve) {
  LoadLevel last = LoadLevel::kFull;
  bool seen[kLoadLevels] = {};
  for (std::int64_t budget = 2 * kFull; budget > 10'000; budget -= budget / 20) {
    Flight flight(Computer{});
    flight.frames(20, budget);
    EXPECT_GE(flight.level(), last) << budget;
    last = flight.level();
    seen[static_cast<std::size_t>(last)] = true;
    const Supervisor::Effort effort = flight.plan().effort;
    if (last == LoadLevel::kFewerFeatures) {
      EXPECT_GT(effort.most_tracks, 0);
      EXPECT_EQ(effort.most_steps, 0);
    } else if (last == LoadLevel::kFewerIterations) {
      EXPECT_EQ(effort.most_steps, 1);
    }
  }
  for (const bool level : seen) EXPECT_TRUE(level);
}

// Whatever the share of the fixed part, which the governor does not know: solves are in time, and not needlessly small.
TEST(LoadGovernor, SolvesFitIntoTheirTime) {
  for (const double fixed_ns : {20'000.0, 50'000.0, 60'000.0}) {
    Computer computer;
    computer.fixed_ns = fixed_ns;
    Flight flight(computer);
    const std::int64_t budget = computer.cost(250) * 6 / 10;
    flight.frames(30, budget);
    const std::uint64_t over = flight.counts().over_budget;
    std::int64_t most = 0;
    for (int i = 0; i < 100; ++i) most = std::max(most, flight.frame(budget));
    EXPECT_EQ(flight.counts().over_budget, over) << fixed_ns;
    EXPECT_LE(most, budget) << fixed_ns;
    EXPECT_GE(most, budget / 2) << fixed_ns;
  }
}

TEST(LoadGovernor, GivesBackAfterAWhileAndNotAtOnce) {
  Flight flight(Computer{});
  flight.frames(20, kShort);
  ASSERT_EQ(flight.level(), LoadLevel::kFewerFeatures);
  flight.frames(4, 2 * kFull);
  EXPECT_EQ(flight.level(), LoadLevel::kFewerFeatures);
  flight.frames(1, 2 * kFull);
  EXPECT_EQ(flight.level(), LoadLevel::kFull);
  EXPECT_EQ(flight.counts().raised, 1u);
}

TEST(LoadGovernor, DoesNotFollowABudgetThatFlickers) {
  Flight flight(Computer{});
  flight.frames(20, kShort);
  const std::uint64_t before = flight.counts().lowered;
  for (int i = 0; i < 100; ++i) flight.frames(1, i % 2 ? kShort : 2 * kFull);
  EXPECT_EQ(flight.counts().raised, 0u);
  EXPECT_EQ(flight.counts().lowered, before);
}

TEST(LoadGovernor, PredictionAloneLetsASolveThroughTwiceASecond) {
  Flight flight(Computer{});
  flight.frames(5, LoadGovernor::kUnlimited);
  int solves = 0;
  for (int i = 0; i < 100; ++i) {  // 10 s
    solves += flight.frame(1'000) > 0;
    EXPECT_EQ(flight.level(), LoadLevel::kPredictionOnly);
  }
  EXPECT_NEAR(solves, 20, 1);
  EXPECT_EQ(flight.counts().let_through, static_cast<std::uint64_t>(solves));
  EXPECT_EQ(flight.counts().over_budget, static_cast<std::uint64_t>(solves));
}

// Less than the least solve takes, but not on average: what predicted frames leave pays for the others.
TEST(LoadGovernor, TimeSavedPaysForASolve) {
  Flight flight(Computer{});
  flight.frames(5, LoadGovernor::kUnlimited);
  const std::int64_t budget = Computer{}.cost(60, 1) / 2;
  std::int64_t spent = 0;
  for (int i = 0; i < 200; ++i) spent += flight.frame(budget, true);
  EXPECT_EQ(flight.level(), LoadLevel::kPredictionOnly);
  EXPECT_LT(spent, 200 * budget * 11 / 10);
  EXPECT_GT(spent, 200 * budget * 6 / 10);
}

TEST(LoadGovernor, AFrameThatCameTooLateCostsOnlyItsOwnSolve) {
  Flight flight(Computer{});
  flight.frames(20, 2 * kFull);
  EXPECT_EQ(flight.frame(-5'000), 0);
  EXPECT_GT(flight.frame(2 * kFull), 0);
  flight.frames(10, 2 * kFull);
  EXPECT_EQ(flight.level(), LoadLevel::kFull);
}

TEST(LoadGovernor, OneSlowSolveIsChanceTwoAreNot) {
  Flight flight(Computer{});
  flight.frames(20, kFull * 3 / 2);
  flight.stretch(10);
  flight.frames(1, kFull * 3 / 2);
  flight.stretch(1);
  flight.frames(20, kFull * 3 / 2);
  EXPECT_EQ(flight.counts().lowered, 0u);
  flight.stretch(2);
  flight.frames(3, kFull * 3 / 2);
  EXPECT_EQ(flight.level(), LoadLevel::kFewerFeatures);
}

TEST(LoadGovernor, EveryFrameIsCountedOnce) {
  Flight flight(Computer{});
  int n = 0;
  for (const std::int64_t budget : {2 * kFull, kShort, kFull / 3, std::int64_t{1'000}, 2 * kFull}) {
    flight.frames(17, budget);
    n += 17;
  }
  const auto& f = flight.counts().frames;
  EXPECT_EQ(std::accumulate(f.begin(), f.end(), std::uint64_t{0}), static_cast<std::uint64_t>(n));
}

TEST(RecentMost, LeavesOutTheLargestOfTheLastFew) {
  RecentMost m;
  EXPECT_EQ(m.get(), 0);
  m.add(5);
  EXPECT_EQ(m.get(), 5);
  m.add(9);
  EXPECT_EQ(m.get(), 5);
  m.add(7);
  EXPECT_EQ(m.get(), 7);
  for (int i = 0; i < 8; ++i) m.add(1);
  EXPECT_EQ(m.get(), 1);
}

}  // namespace
}  // namespace epiline
