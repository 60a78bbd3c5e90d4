#pragma once
// What must hold for every visual factor.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "estimator/estimator.h"
#include "estimator/solver/marginalise.h"
#include "platform/memory/allocation_count.h"
#include "tests/estimator/dense_algebra.h"
#include "tests/estimator/dense_system.h"
#include "tests/estimator/estimator/rig.h"
#include "tests/estimator/factors/smooth_settings.h"
#include "tests/estimator/solver/solver_fixture.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline::test {

/// The instruction sets that this machine runs.
inline std::vector<InstructionSet> sets_here() {
  std::vector<InstructionSet> sets;
  for (const InstructionSet set : kInstructionSets)
    if (runs_here(set)) sets.push_back(set);
  return sets;
}

/// Every number of the normal equations, marginalisation included, must not depend on the instruction set.
template <class Factor>
void expect_same_on_every_set() {
  SyntheticWindow s = make_window({.pixel_noise = 1});
  VisualSettings settings = smooth_settings();
  settings.cauchy = 2;
  settings.inner_steps = 1;
  settings.gate = true;
  const auto reference = std::make_unique<VisualSystem>(), other = std::make_unique<VisualSystem>();
  for (const bool marginal : {false, true}) {
    auto run = [&](InstructionSet set, VisualSystem& out) {
      Factor factor(set);
      factor.collect(*s.window, settings);
      if (marginal)
        factor.marginalise_oldest(*s.window, settings, out);
      else
        factor.linearise(*s.window, out);
    };
    run(sets_here().back(), *reference);
    for (const InstructionSet set : sets_here()) {
      const char* name = name_of(set);
      run(set, *other);
      const int n = s.window->size() - (marginal ? 1 : 0);
      for (int i = 0; i < n; ++i) {
        for (int j = i; j < n; ++j)
          for (int q = 0; q < 36; ++q)
            EXPECT_NEAR(reference->H[i][j][q], other->H[i][j][q], 1e-9 * std::abs(reference->H[i][i][0]) + 1e-4)
                << name;
        for (int q = 0; q < 6; ++q)
          EXPECT_NEAR(reference->b[i][q], other->b[i][q], 1e-6 + 1e-9 * std::abs(reference->b[i][q])) << name;
        for (int q = 0; q < 42; ++q)
          EXPECT_NEAR(reference->H_ck[i][q], other->H_ck[i][q], 1e-4 + 1e-9 * std::abs(reference->H_ck[i][q])) << name;
      }
      EXPECT_NEAR(reference->cost, other->cost, 1e-9 * reference->cost);
    }
  }
}

/// Ten rounds through a small window, as a flight does it.
inline void expect_prior_stays_positive(VisualFactorModel& factor) {
  SyntheticWindow s = make_window({.frames = 20});
  Window& w = *s.window;
  set_initial_prior(w, {}, calibration_sigmas());
  VisualSettings settings;
  settings.gate = false;
  settings.extrinsics = true;
  Marginaliser marginaliser(best_instruction_set());
  for (int round = 0; round < 15; ++round) {
    factor.collect(w, settings);
    marginaliser.marginalise_oldest(w, factor, settings);
    const Eigen::MatrixXd H = dense_prior(w.prior);
    ASSERT_TRUE(H.allFinite() && dense_prior_rhs(w.prior).allFinite());
    EXPECT_GE(least_eigenvalue(H), -1e-9 * H.norm()) << "round " << round;
  }
  EXPECT_EQ(w.size(), 5);
}

/// Gives every frame the same effort.
class Frugal final : public Supervisor {
 public:
  Effort effort() noexcept override { return given; }
  Effort given;
};

/// An estimator with these settings and that little effort.
inline void expect_little_effort_suffices(const EstimatorConfig& config, const Supervisor::Effort& effort) {
  // GIVEN an estimator that flies with all it has, then with fewer tracks or one untried step
  Frugal frugal;
  Rig rig({.moving_from = 2}, config);
  rig.supervisor = &frugal;
  rig.run_to(5);
  ASSERT_EQ(rig.odometry().health.state, HealthState::kTracking);
  const EstimatorStats before = rig.stats();
  Rig full({.moving_from = 2}, config);
  full.run_to(8);
  frugal.given = effort;
  rig.run_to(8);
  // THEN that is what it spends, its health tells it, it is less certain than with all it has, and its state is as good
  // as it says
  const double solves = static_cast<double>(rig.stats().solves - before.solves);
  ASSERT_GT(solves, 20);
  if (frugal.given.most_tracks > 0) {
    EXPECT_EQ(static_cast<double>(rig.stats().tracks_used - before.tracks_used), frugal.given.most_tracks * solves);
    EXPECT_GT(rig.stats().tracks_offered - before.tracks_offered, 2 * (rig.stats().tracks_used - before.tracks_used));
    EXPECT_GT(rig.sigma_velocity(), full.sigma_velocity());
  }
  if (frugal.given.most_steps == 1) {
    EXPECT_EQ(static_cast<double>(rig.stats().linearisations - before.linearisations), solves);
  }
  EXPECT_TRUE(rig.has(HealthReason::kOverloaded));
  EXPECT_EQ(rig.odometry().health.state, HealthState::kDegraded);
  EXPECT_LT(rig.velocity_error(), 0.1);
  EXPECT_EQ(rig.stats().resets, 0u);
  // AND with full effort its health no longer tells it
  frugal.given = {};
  rig.run_to(9);
  EXPECT_FALSE(rig.has(HealthReason::kOverloaded));
  EXPECT_EQ(rig.odometry().health.state, HealthState::kTracking);
}

/// After construction, with features and without, with a camera and without.
inline void expect_no_heap_calls(const EstimatorConfig& config) {
  for (const double moving_from : {-2.0, 1.5}) {
    Rig rig({.moving_from = moving_from}, config);
    const HeapCallScope scope;
    rig.run_to(4);
    rig.features = false;
    rig.run_to(5);
    rig.features = true;
    rig.camera = false;
    rig.run_to(11);
    rig.camera = true;
    rig.run_to(13);
    EXPECT_EQ(scope.calls(), 0u);
    EXPECT_GT(rig.stats().frames_solved, 10u);
  }
}

}  // namespace epiline::test
