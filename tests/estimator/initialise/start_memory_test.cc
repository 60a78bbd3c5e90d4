// How an attempt to start goes on from where the last one ended. Derivation: docs/derivations/initialisation.md.
#include <gtest/gtest.h>

#include <vector>

#include "estimator/initialise/moving_start.h"
#include "tests/estimator/initialise/start_flight.h"
#include "tests/estimator/initialise/start_work.h"

namespace epiline::test {
namespace {

/// The frames of a flight from `first` on, with their ids.
struct Attempt {
  std::vector<StartTrack> tracks;
  StartProblem problem;

  Attempt(const StartFlight& f, int first, int frames) : problem(f.problem) {
    for (const StartTrack& t : f.tracks) {
      StartTrack part;
      for (int q = 0; q < t.count; ++q) {
        const int k = t.frame[q] - first;
        if (k < 0 || k >= frames) continue;
        part.frame[part.count] = static_cast<std::uint8_t>(k);
        part.f_C[part.count++] = t.f_C[q];
      }
      if (part.count > 0) tracks.push_back(part);
    }
    problem.frames = frames;
    problem.interval = f.interval.data() + first;
    problem.tracks = tracks;
    for (int k = 0; k < frames; ++k) problem.id[k] = static_cast<std::uint64_t>(100 + first + k);
  }
};

StartFlight fly_for_two_attempts(unsigned seed, const Vec3& b_g = Vec3::Zero()) {
  return wander(seed, {.frames = kStartFrames, .noise_rad = 0.5 / 458, .b_g = b_g});
}

/// Frame 0 leaves between two attempts: the second begins at its own frame 0, where the first ended there, and ends
/// where a search does.
TEST(StartMemory, BeginsWhereTheLastAttemptEnded) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const StartFlight f = fly_for_two_attempts(seed, 0.2 * Vec3(-0.003, 0.021, 0.079));
    const Attempt first(f, 0, 12), second(f, 3, 12);
    StartMemory memory, nothing;
    StartGuess g, expected;
    ASSERT_EQ(solve_moving_start(first.problem, {}, work_space(), memory, g), std::nullopt) << "seed " << seed;
    EXPECT_FALSE(g.continued);
    EXPECT_EQ(memory.at(99), nullptr);
    EXPECT_EQ(memory.at(112), nullptr);
    const StartState* carried = memory.at(103);
    ASSERT_NE(carried, nullptr);
    const Mat3 R = f.R[3].transpose();
    EXPECT_LT((carried->g_0 - R * f.truth.g_0).norm(), kGravity * 4 * g.sigma_tilt) << "seed " << seed;
    EXPECT_LT((carried->v_0 - g.R[3].transpose() * g.v[3]).norm(), 1e-9) << "seed " << seed;
    StartLimits none_passes;
    none_passes.sigma_scale = 0;
    const auto refused = StartRefusal::kScaleUncertain;
    EXPECT_EQ(solve_moving_start(second.problem, none_passes, work_space(), memory, g), refused) << "seed " << seed;
    EXPECT_TRUE(g.continued) << "seed " << seed;
    EXPECT_EQ(solve_moving_start(second.problem, none_passes, work_space(), nothing, expected), refused);
    EXPECT_FALSE(expected.continued);
    EXPECT_LT((g.state.v_0 - expected.state.v_0).norm(), 0.2 * expected.sigma_velocity) << "seed " << seed;
    EXPECT_LT(angle(g.state.g_0, expected.state.g_0), 0.2 * expected.sigma_tilt) << "seed " << seed;
    EXPECT_NEAR(g.parallax_rad, expected.parallax_rad, 0.25 * expected.parallax_rad) << "seed " << seed;
  }
}

/// Going on may lead into another minimum than a search does, so a start that is accepted was searched for.
TEST(StartMemory, NoStartIsAcceptedWithoutASearch) {
  int accepted = 0;
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const StartFlight f = fly_for_two_attempts(seed);
    const Attempt first(f, 0, 12), second(f, 3, 12);
    StartMemory memory, nothing;
    StartGuess g, expected;
    ASSERT_EQ(solve_moving_start(first.problem, {}, work_space(), memory, g), std::nullopt) << "seed " << seed;
    nothing.unexplained = memory.unexplained;  // which state a search begins with
    const auto refusal = solve_moving_start(second.problem, {}, work_space(), memory, g);
    EXPECT_EQ(solve_moving_start(second.problem, {}, work_space(), nothing, expected), refusal) << "seed " << seed;
    if (refusal) continue;
    ++accepted;
    EXPECT_FALSE(g.continued) << "seed " << seed;
    EXPECT_EQ(g.state.v_0, expected.state.v_0) << "seed " << seed;
    EXPECT_EQ(g.parallax_rad, expected.parallax_rad) << "seed " << seed;
  }
  EXPECT_GT(accepted, 5);
}

/// A state that does not explain the images is left for a search, whatever it was before.
TEST(StartMemory, SearchesWhereTheLastStateFitsNoLonger) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    StartFlight f = wander(seed, {.noise_rad = 0.5 / 458});
    const Attempt attempt(f, 0, f.problem.frames);
    StartMemory memory, nothing;
    StartGuess g, expected;
    ASSERT_EQ(solve_moving_start(attempt.problem, {}, work_space(), memory, g), std::nullopt) << "seed " << seed;
    memory.state[0].v_0 += Vec3(-20, 30, 20);
    memory.state[0].g_0 *= -1;
    EXPECT_EQ(solve_moving_start(attempt.problem, {}, work_space(), memory, g), std::nullopt) << "seed " << seed;
    ASSERT_EQ(solve_moving_start(attempt.problem, {}, work_space(), nothing, expected), std::nullopt);
    EXPECT_FALSE(g.continued) << "seed " << seed;
    EXPECT_LT((g.state.v_0 - expected.state.v_0).norm(), 0.2 * expected.sigma_velocity) << "seed " << seed;
    EXPECT_LT(angle(g.state.g_0, expected.state.g_0), 0.2 * expected.sigma_tilt) << "seed " << seed;
  }
}

/// Where nothing explains the images, a state is kept while it fits as well as the last search's; every fourth attempt
/// searches all the same.
TEST(StartMemory, SearchesNowAndThenWhereNothingExplains) {
  StartFlight f = fly(wandering(3), {.frames = 8, .noise_rad = 2 / 458.0});  // with so few frames no noise is found
  f.problem.sigma_rad = 0.5 / 458;
  const Attempt attempt(f, 0, f.problem.frames);
  StartMemory memory;
  StartGuess g;
  for (int n = 0; n < 9; ++n) {
    EXPECT_EQ(solve_moving_start(attempt.problem, {}, work_space(), memory, g), StartRefusal::kResidualTooLarge);
    EXPECT_EQ(g.continued, n % 4 != 0) << n;
    EXPECT_EQ(memory.unexplained, n + 1);
  }
  memory = {};
  EXPECT_EQ(solve_moving_start(attempt.problem, {}, work_space(), memory, g), StartRefusal::kResidualTooLarge);
  EXPECT_FALSE(g.continued);
}

}  // namespace
}  // namespace epiline::test
