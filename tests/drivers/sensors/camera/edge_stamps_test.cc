// Images and edges of a simulated camera, whose true pairs are known: no stamp may ever be that of another image.
#include "drivers/sensors/camera/edge_stamps.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <map>
#include <random>

namespace epiline {
namespace {

struct World {
  double period_ns = 33.3e6;
  double lag = 0.2;            ///< of a period: what the driver says too late
  double stamp_jitter = 0.05;  ///< of a period, either way
  double edge_jitter_ns = 10e3;
  double edges_lost = 0, images_lost = 0, images_lost_uncounted = 0,
         extra_edges = 0;  ///< shares; an extra edge is a bounce
  int images = 600;
  unsigned seed = 1;
};

struct Tally {
  std::map<EdgeMatch, int> outcomes;
  int wrong = 0;              ///< stamps that are another image's
  double worst_guess_ns = 0;  ///< of kNoEdge
  EdgeCounts counts;
};

/// `change(i, world)` may change the world on the way.
template <class Change>
Tally fly(World world, Change change) {
  std::mt19937 random(world.seed);
  const auto uniform = [&](double from, double to) { return std::uniform_real_distribution<>(from, to)(random); };
  const auto happens = [&](double share) { return share > 0 && uniform(0, 1) < share; };
  EdgeStamps stamps;
  Tally tally;
  std::uint64_t sequence = 1'000;
  double time_ns = 5e9;
  for (int i = 0; i < world.images; ++i) {
    change(i, world);
    time_ns += world.period_ns;
    const HostStamp truth{static_cast<std::int64_t>(time_ns + uniform(-1, 1) * world.edge_jitter_ns)};
    const bool is_lost = happens(world.edges_lost);
    if (!is_lost) stamps.add_edge(truth);
    if (!is_lost && happens(world.extra_edges))
      stamps.add_edge(truth + Span{static_cast<std::int64_t>(0.1 * world.period_ns)});
    if (happens(world.images_lost_uncounted)) continue;
    ++sequence;
    if (happens(world.images_lost)) continue;
    const double late = (world.lag + uniform(-1, 1) * world.stamp_jitter) * world.period_ns;
    HostStamp start = truth + Span{static_cast<std::int64_t>(late)};
    const EdgeMatch match = stamps.match(sequence, start);
    ++tally.outcomes[match];
    const double off_ns = static_cast<double>(std::abs((start - truth).ns));
    if (match == EdgeMatch::kEdge && off_ns > 0) ++tally.wrong;
    if (match == EdgeMatch::kNoEdge) tally.worst_guess_ns = std::max(tally.worst_guess_ns, off_ns);
  }
  tally.counts = stamps.counts();
  return tally;
}
Tally fly(const World& world) {
  return fly(world, [](int, World&) {});
}

TEST(EdgeStamps, EveryImageGetsItsEdge) {
  for (const double lag : {-0.4, 0.0, 0.2, 0.4}) {
    const World world{.lag = lag};
    const Tally tally = fly(world);
    EXPECT_EQ(tally.wrong, 0);
    EXPECT_EQ(tally.outcomes.at(EdgeMatch::kEdge), world.images - 11 - 7) << "12 edges to begin, 8 images to learn";
    EXPECT_NEAR(tally.counts.lag.seconds() * 1e9, lag * world.period_ns, 0.02 * world.period_ns);
    EXPECT_NEAR(tally.counts.period.seconds() * 1e9, world.period_ns, 1e3);
  }
}

TEST(EdgeStamps, WithoutEdgesNoImageIsUsed) {
  EXPECT_EQ(fly({.edges_lost = 1}).outcomes.at(EdgeMatch::kUnsure), World().images);
}

TEST(EdgeStamps, ALostEdgeIsReplacedByTheOthersRate) {
  const World world{.edges_lost = 0.1};
  const Tally tally = fly(world);
  EXPECT_EQ(tally.wrong, 0);
  EXPECT_GT(tally.outcomes.at(EdgeMatch::kNoEdge), 30);
  EXPECT_NEAR(static_cast<double>(tally.counts.missing), tally.outcomes.at(EdgeMatch::kNoEdge), 3)
      << "but at the start";
  EXPECT_LT(tally.worst_guess_ns, 5 * world.edge_jitter_ns) << "much better than the driver's stamp";
  EXPECT_EQ(tally.outcomes.count(EdgeMatch::kMismatch), 0u);
}

TEST(EdgeStamps, ALineThatBreaksLeavesTheDriversStampsLessTheirLag) {
  World world;
  const Tally tally = fly(world, [](int i, World& w) { w.edges_lost = i < 300 ? 0 : 1; });
  EXPECT_EQ(tally.wrong, 0);
  EXPECT_GE(tally.outcomes.at(EdgeMatch::kNoEdge), 300);
  EXPECT_LT(tally.worst_guess_ns, 0.08 * world.period_ns) << "their jitter, not their lag";
}

TEST(EdgeStamps, AnUncountedLossIsSeenAndOvercome) {
  const Tally tally = fly({}, [](int i, World& w) { w.images_lost_uncounted = i == 300 ? 1 : 0; });
  EXPECT_EQ(tally.wrong, 0);
  EXPECT_EQ(tally.outcomes.at(EdgeMatch::kMismatch), 2);
  EXPECT_EQ(tally.counts.resynchronised, 1u);
}

TEST(EdgeStamps, ARestartOfTheCameraNeedsThreeImages) {
  EdgeStamps stamps;
  int unsure = 0;
  for (std::int64_t i = 0; i < 100; ++i) {
    const HostStamp edge{1'000'000'000 + i * 20'000'000};
    stamps.add_edge(edge);
    if (i == 50) stamps.restart();
    HostStamp start = edge + Span{3'000'000};
    const EdgeMatch match = stamps.match(static_cast<std::uint64_t>(i < 50 ? i : i + 777), start);
    if (i >= 50 && match == EdgeMatch::kUnsure) ++unsure;
    if (match == EdgeMatch::kEdge) {
      EXPECT_EQ(start, edge);
    }
    EXPECT_NE(match, EdgeMatch::kMismatch);
  }
  EXPECT_EQ(unsure, 2);
}

TEST(EdgeStamps, AnotherRateIsLearned) {
  const Tally tally = fly({}, [](int i, World& w) { w.period_ns = i < 200 ? 33.3e6 : i < 400 ? 50e6 : 20e6; });
  EXPECT_EQ(tally.wrong, 0);
  EXPECT_GT(tally.outcomes.at(EdgeMatch::kEdge), 400);
  EXPECT_NEAR(tally.counts.period.seconds() * 1e9, 20e6, 0.1e6);
}

RC_GTEST_PROP(EdgeStamps, NoStampIsEverThatOfAnotherImage, ()) {
  World world;
  world.seed = *rc::gen::arbitrary<unsigned>();
  world.period_ns = 1e6 * *rc::gen::inRange(5, 200);
  world.stamp_jitter = 0.01 * *rc::gen::inRange(0, 12);
  world.lag = 0.01 * *rc::gen::inRange(-36, 37);
  world.edge_jitter_ns = world.period_ns * 0.001 * *rc::gen::inRange(0, 20);
  world.edges_lost = 0.01 * *rc::gen::inRange(0, 40);
  world.images_lost = 0.01 * *rc::gen::inRange(0, 40);
  world.images_lost_uncounted = 0.001 * *rc::gen::inRange(0, 20);
  world.extra_edges = 0.01 * *rc::gen::inRange(0, 5);
  const Tally tally = fly(world);
  RC_ASSERT(tally.wrong == 0);
  RC_ASSERT(tally.worst_guess_ns < 0.26 * world.period_ns);
}

}  // namespace
}  // namespace epiline
