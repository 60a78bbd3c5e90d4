// What the solver does when time is up or a step fails.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "tests/estimator/solver/solver_fixture.h"

namespace epiline {
namespace {

using test::calibration_sigmas;
using test::kEverything;
using test::quadratic;

class AlwaysLate final : public Supervisor {
 public:
  bool time_is_up() noexcept override { return true; }
};

TEST(Solver, StopsAfterTheFirstAcceptedStepWhenTimeIsUp) {
  SyntheticWindow hurried = make_window({.state_error = 0.02}), single = make_window({.state_error = 0.02});
  for (SyntheticWindow* s : {&hurried, &single}) set_initial_prior(*s->window, {}, calibration_sigmas());
  TrackFactor factor(best_instruction_set());
  Solver solver(best_instruction_set());
  AlwaysLate late;
  Supervisor patient;
  factor.collect(*single.window, quadratic(false));
  solver.optimise(*single.window, factor, {1, true, false}, patient);
  factor.restart();
  factor.collect(*hurried.window, quadratic(false));
  const SolverSummary r = solver.optimise(*hurried.window, factor, {10, true, false}, late);
  EXPECT_TRUE(r.solved());
  EXPECT_EQ(r.outcome, SolverOutcome::kOutOfTime);
  EXPECT_EQ(r.accepted, 1);
  EXPECT_LT(r.cost, 0.5 * r.cost_first);
  for (int k = 0; k < hurried.window->size(); ++k) {  // the whole of one step, nothing of a second
    EXPECT_EQ(hurried.window->at(k).x.p, single.window->at(k).x.p);
    EXPECT_EQ(hurried.window->at(k).x.R, single.window->at(k).x.R);
    EXPECT_EQ(hurried.window->at(k).x.b_g, single.window->at(k).x.b_g);
  }
  EXPECT_NEAR(solver.linearise(*hurried.window, factor, {10, true, false}), r.cost, 1e-9 * r.cost);
}

/// Works as the track factor does, but that its first linearisation or its trials cost `bad`.
class Failing final : public VisualFactorModel {
 public:
  enum class At { kLinearisation, kTrial };
  Failing(At at, double bad) : track_(best_instruction_set()), at_(at), bad_(bad) {}
  void collect(const Window& w, const VisualSettings& s) noexcept override { track_.collect(w, s); }
  void linearise(const Window& w, VisualSystem& out) noexcept override {
    track_.linearise(w, out);
    if (at_ == At::kLinearisation) out.cost = bad_;
  }
  double cost(const Window& w) noexcept override { return at_ == At::kTrial ? bad_ : track_.cost(w); }
  void marginalise_oldest(const Window& w, const VisualSettings& s, VisualSystem& out) noexcept override {
    track_.marginalise_oldest(w, s, out);
  }

 private:
  TrackFactor track_;
  At at_;
  double bad_;
};

TEST(Solver, PutsTheStateBackExactlyWhenAStepIsRejected) {
  for (const double bad : {1e12, std::nan(""), std::numeric_limits<double>::infinity()}) {
    SyntheticWindow s = make_window({});
    Window& w = *s.window;
    set_initial_prior(w, {}, calibration_sigmas());
    std::vector<NavState> before;
    for (int k = 0; k < w.size(); ++k) before.push_back(w.at(k).x);
    const Calibration calibration = w.calibration;
    Failing factor(Failing::At::kTrial, bad);
    Solver solver(best_instruction_set());
    Supervisor supervisor;
    factor.collect(w, quadratic(true));
    const SolverSummary r = solver.optimise(w, factor, kEverything, supervisor);
    EXPECT_EQ(r.outcome, SolverOutcome::kGaveUp);
    EXPECT_FALSE(r.solved());
    EXPECT_EQ(r.accepted, 0);
    EXPECT_GT(r.rejected, 1);
    for (int k = 0; k < w.size(); ++k) {
      const NavState& x = w.at(k).x;
      const NavState& y = before[static_cast<std::size_t>(k)];
      EXPECT_TRUE(x.p == y.p && x.R == y.R && x.v == y.v && x.b_a == y.b_a && x.b_g == y.b_g) << "frame " << k;
    }
    EXPECT_TRUE(w.calibration.time_offset == calibration.time_offset && w.calibration.R_BC == calibration.R_BC &&
                w.calibration.p_BC == calibration.p_BC);
  }
}

TEST(Solver, ReportsACostThatIsNotANumber) {
  SyntheticWindow s = make_window({});
  set_initial_prior(*s.window, {}, calibration_sigmas());
  Failing factor(Failing::At::kLinearisation, std::nan(""));
  Solver solver(best_instruction_set());
  Supervisor supervisor;
  factor.collect(*s.window, quadratic(false));
  EXPECT_EQ(solver.optimise(*s.window, factor, {3, true, false}, supervisor).outcome, SolverOutcome::kNotFinite);
}

/// In a window whose velocity is off by 0.3 m/s, every step being refused: nothing of the solver's may be taken for
/// knowledge.
TEST(Solver, HandsOutNoCovarianceWhenItGivesUp) {
  SyntheticWindow s = make_window({});
  Window& w = *s.window;
  set_initial_prior(w, {}, calibration_sigmas());
  for (int k = 0; k < w.size(); ++k) w.at(k).x.v += Vec3(0.3, 0, 0);
  Failing factor(Failing::At::kTrial, 1e12);
  Solver solver(best_instruction_set());
  Supervisor supervisor;
  factor.collect(w, quadratic(false));
  const SolverSummary r = solver.optimise(w, factor, {3, true, false}, supervisor);
  EXPECT_EQ(r.outcome, SolverOutcome::kGaveUp);
  EXPECT_TRUE(r.failed());
  EXPECT_EQ(r.rejected, Solver::kMostAttempts);
}

/// Half of the tracks jump to and fro; the gate stands back and none is dropped, but they are counted, and the trial
/// step must not forget them.
TEST(Solver, CountsTheTracksThatContradictTheMotionWhenNoneIsDropped) {
  SyntheticWindow s = make_window({.frames = 8, .tracks = 120});
  Window& w = *s.window;
  set_initial_prior(w, {}, calibration_sigmas());
  for (int i = 0; i < w.track_count(); i += 2)
    for (int k = 0; k < w.size(); ++k)
      if (w.seen(w.track(i), k)) {
        Observation& o = w.view(w.track(i), k);
        const Mat3 Q = so3_exp(0.05 * (k % 2 ? 1 : -1) * o.f_C.unitOrthogonal());
        o.f_C = Q * o.f_C;
        o.chart = o.chart * Q.transpose();
      }
  TrackFactor factor(best_instruction_set());
  VisualSettings settings;
  factor.collect(w, settings);
  Solver solver(best_instruction_set());
  Supervisor supervisor;
  const SolverSummary r = solver.optimise(w, factor, {1, true, false}, supervisor);
  EXPECT_TRUE(factor.gate_suspended());
  EXPECT_GT(r.gated, 0.4 * r.tracks);
}

}  // namespace
}  // namespace epiline
