// What the solver does when time is up or a step fails.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "tests/estimator/dense_system.h"
#include "tests/estimator/solver/solver_fixture.h"

namespace epiline::test {
namespace {

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

/// Works as the track factor does, but that linearisations from `first` on, or all trials, cost `bad`.
class Failing final : public VisualFactorModel {
 public:
  enum class At { kLinearisation, kTrial };
  Failing(At at, double bad, int first = 0) : track_(best_instruction_set()), at_(at), bad_(bad), first_(first) {}
  void collect(const Window& w, const VisualSettings& s) noexcept override { track_.collect(w, s); }
  void linearise(const Window& w, VisualSystem& out) noexcept override {
    track_.linearise(w, out);
    if (at_ == At::kLinearisation && count_++ >= first_) out.cost = bad_;
  }
  double cost(const Window& w) noexcept override {
    return at_ == At::kTrial && count_++ < first_trials ? bad_ : track_.cost(w);
  }
  void marginalise_oldest(const Window& w, const VisualSettings& s, VisualSystem& out) noexcept override {
    track_.marginalise_oldest(w, s, out);
  }
  int first_trials = 1000;  ///< so many trials are bad

 private:
  TrackFactor track_;
  At at_;
  double bad_;
  int first_, count_ = 0;
};

/// Pulls the newest frame along x, as weakly as images pull the scale in cruise, to one place; each step aims 2.2 times
/// as far.
class Overshooting final : public VisualFactorModel {
 public:
  void collect(const Window&, const VisualSettings&) noexcept override {}
  void linearise(const Window& w, VisualSystem& out) noexcept override {
    clear(out, w.size());
    const int n = w.size() - 1;
    out.H[n][n][0] = kInformation;
    out.b[n][0] = kInformation * kTooFar * (place - w.at(n).x.p.x());
    out.cost = cost(w);
  }
  double cost(const Window& w) noexcept override {
    const double off = place - w.newest().x.p.x();
    return kInformation * kTooFar * off * off;
  }
  void marginalise_oldest(const Window& w, const VisualSettings&, VisualSystem& out) noexcept override {
    clear(out, w.size());
  }
  double place = 0;

 private:
  static constexpr double kInformation = 100, kTooFar = 2.2;
};

/// A window with a prior whose velocities are off by 0.3 m/s, and what it held before.
struct Attempt {
  Attempt() {
    set_initial_prior(w, {}, calibration_sigmas());
    for (int k = 0; k < w.size(); ++k) w.at(k).x.v += Vec3(0.3, 0, 0);
    keep();
  }
  void keep() {
    before.clear();
    for (int k = 0; k < w.size(); ++k) before.push_back(w.at(k).x);
    calibration = w.calibration;
  }
  SolverSummary solve(VisualFactorModel& factor, const SolverSettings& settings) {
    factor.collect(w, quadratic(true));
    return solver.optimise(w, factor, settings, *supervisor);
  }
  /// State and covariance leave together: here neither does.
  void expect_nothing_left() const {
    for (int k = 0; k < w.size(); ++k) {
      const NavState& x = w.at(k).x;
      const NavState& y = before[static_cast<std::size_t>(k)];
      const auto same = [](const auto& a, const auto& b) { return std::memcmp(a.data(), b.data(), sizeof a) == 0; };
      EXPECT_TRUE(same(x.p, y.p) && same(x.R, y.R) && same(x.v, y.v) && same(x.b_a, y.b_a) && same(x.b_g, y.b_g))
          << "frame " << k;
    }
    EXPECT_TRUE(local(calibration, w.calibration).isZero(0));
    EXPECT_TRUE(solver.covariance().array().isNaN().all()) << "taken for knowledge";
    EXPECT_TRUE(solver.calibration_covariance().array().isNaN().all());
  }

  SyntheticWindow s = make_window({});
  Window& w = *s.window;
  Solver solver{best_instruction_set()};
  Supervisor patient;
  Supervisor* supervisor = &patient;
  std::vector<NavState> before;
  Calibration calibration;
};

/// Damping, relative to what is known of a frame against its neighbours, would hold the way that they all go together.
TEST(Solver, TakesAShorterStepWhereAllOfItLeadsTooFar) {
  SyntheticWindow s = make_window({.state_error = 0});
  Window& w = *s.window;
  set_initial_prior(w, {.sigma_v = 10}, calibration_sigmas());
  Overshooting factor;
  factor.place = w.newest().x.p.x() + 2;
  Solver solver(best_instruction_set());
  Supervisor patient;
  EXPECT_TRUE(solver.optimise(w, factor, {10, false, false}, patient).solved());
  EXPECT_NEAR(w.newest().x.p.x(), factor.place, 0.1);
}

TEST(Solver, GivesUpWhenEveryStepIsRejectedAndLeavesNothing) {
  for (const double bad : {1e12, std::nan(""), std::numeric_limits<double>::infinity()}) {
    Attempt a;
    Failing factor(Failing::At::kTrial, bad);
    const SolverSummary r = a.solve(factor, {3, true, true});
    EXPECT_EQ(r.outcome, SolverOutcome::kGaveUp);
    EXPECT_TRUE(r.failed() && !r.solved());
    EXPECT_EQ(r.accepted, 0);
    EXPECT_EQ(r.rejected, Solver::kMostAttempts);
    a.expect_nothing_left();
  }
}

TEST(Solver, IsOutOfTimeWithoutAnyStepWhenTheFirstIsRejectedLate) {
  Attempt a;
  AlwaysLate late;
  a.supervisor = &late;
  Failing factor(Failing::At::kTrial, 1e12);
  const SolverSummary r = a.solve(factor, {3, true, true});
  EXPECT_EQ(r.outcome, SolverOutcome::kOutOfTime);
  EXPECT_EQ(r.rejected, 1);
  EXPECT_FALSE(r.solved());
  EXPECT_FALSE(r.failed()) << "want of time is no fault";
  a.expect_nothing_left();
}

/// Also where a step had been accepted before.
TEST(Solver, TakesEverythingBackWhenACostIsNotANumber) {
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity()})
    for (const int accepted : {0, 1, 2}) {
      Attempt a;
      Failing factor(Failing::At::kLinearisation, bad, accepted);
      const SolverSummary r = a.solve(factor, {10, true, true});
      EXPECT_EQ(r.outcome, SolverOutcome::kNotFinite);
      EXPECT_EQ(r.accepted, accepted);
      EXPECT_TRUE(r.failed() && !r.solved());
      a.expect_nothing_left();
    }
}

TEST(Solver, LeavesAWindowAloneInWhichANumberIsNone) {
  for (const int number : {0, 1, 2, 3, 4}) {
    Attempt a;
    NavState& x = a.w.at(3).x;
    double* const spoilt[] = {&x.p[1], &x.v[0], &x.R(2, 0), &x.b_a[2], &x.b_g[1]};
    *spoilt[number] = std::nan("");
    a.keep();
    TrackFactor factor(best_instruction_set());
    const SolverSummary r = a.solve(factor, {3, true, true});
    EXPECT_TRUE(r.failed()) << number;
    a.expect_nothing_left();
  }
}

/// Without a prior nothing holds position and heading: the normal equations have no solution.
TEST(Solver, EndsWithoutAStepWherePositionIsFree) {
  Attempt a;
  a.w.prior.frames = 0;
  for (int k = 1; k < a.w.size(); ++k) a.w.at(k).L_inverse.setZero();  // and nothing ties velocities and biases
  TrackFactor factor(best_instruction_set());
  const SolverSummary r = a.solve(factor, {3, true, true, false, false, 1});
  EXPECT_FALSE(r.solved());
  EXPECT_EQ(r.accepted, 0);
  a.expect_nothing_left();
}

/// The damping that made the step acceptable must not pass for knowledge.
TEST(Solver, HandsOutTheUndampedCovarianceAfterARejection) {
  Attempt a;
  Failing factor(Failing::At::kTrial, 1e12);
  factor.first_trials = 3;  // all of the step, half of it, and the first that is damped
  const SolverSummary r = a.solve(factor, {1, true, true});
  ASSERT_TRUE(r.solved());
  EXPECT_EQ(r.rejected, 2);
  a.solver.linearise(a.w, factor, {1, true, true});
  const DenseSolution reference = solve_dense(dense(a.solver.system()));
  const int n = a.w.size();
  for (int i = 0; i < 15; ++i) {
    const int row = i < 6 ? pose_column(n - 1) + i : velocity_row(n, n - 1) + i - 6;
    EXPECT_NEAR(a.solver.covariance()(i, i) / reference.covariance(row, row), 1, 1e-6) << i;
  }
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
        const Mat3 Q = so3_exp(0.05 * (k % 2 ? 1 : -1) * bearing_of(o).unitOrthogonal());
        set_view(Q * bearing_of(o), chart_of(o) * Q.transpose(), o);
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
}  // namespace epiline::test
