// Stages of the window solver on a window of the usual size (11 frames, about 290 tracks), each instruction set this
// machine has; the slowest set is the yardstick in the same run.
#include <benchmark/benchmark.h>

#include <cstring>
#include <iterator>

#include "drivers/laboratory/factors/epipolar.h"
#include "drivers/laboratory/factors/reprojection.h"
#include "estimator/factors/prior.h"
#include "estimator/factors/track.h"
#include "estimator/solver/marginalise.h"
#include "estimator/solver/solver.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline {
namespace {

constexpr SolverSettings kSettings{.steps = 1, .estimate_time_offset = true, .estimate_extrinsics = false};

/// The index-th of the sets compiled, the widest first. False: it does not run here.
bool set_here(int index, InstructionSet& set) {
  if (index >= static_cast<int>(std::size(kInstructionSets))) return false;
  set = kInstructionSets[index];
  return runs_here(set);
}

SyntheticWindow usual_window() {
  SyntheticWindow s = make_window({.frames = 11, .tracks = 290, .pixel_noise = 0.5});
  CalibrationTangent sigmas = CalibrationTangent::Constant(5e-3);
  set_initial_prior(*s.window, {}, sigmas);
  return s;
}

template <class Factor>
void linearise(benchmark::State& state, int index) {
  InstructionSet set;
  if (!set_here(index, set)) return state.SkipWithError("not on this machine");
  SyntheticWindow s = usual_window();
  Factor factor(set);
  const auto system = std::make_unique<VisualSystem>();
  factor.collect(*s.window, {});
  for (auto _ : state) factor.linearise(*s.window, *system);
  state.counters["tracks"] = system->tracks;
  state.counters["residuals"] = system->residuals;
}

constexpr auto linearise_tracks = linearise<TrackFactor>;
constexpr auto linearise_epipolar = linearise<EpipolarFactor>;
constexpr auto linearise_reprojection = linearise<ReprojectionFactor>;

void factorise(benchmark::State& state, int index) {
  InstructionSet set;
  if (!set_here(index, set)) return state.SkipWithError("not on this machine");
  SyntheticWindow s = usual_window();
  TrackFactor factor(set);
  Solver solver(set);
  factor.collect(*s.window, {});
  solver.linearise(*s.window, factor, kSettings);
  const auto keep = std::make_unique<LinearSystem>(solver.system());
  const auto work = std::make_unique<LinearSystem>();
  for (auto _ : state) {
    std::memcpy(work.get(), keep.get(), sizeof *work);  // in place: the copy is part of the figure
    benchmark::DoNotOptimize(elimination_kernels(set).factorise(*work, 0));
  }
}

void solve_window(benchmark::State& state, int index) {
  InstructionSet set;
  if (!set_here(index, set)) return state.SkipWithError("not on this machine");
  SyntheticWindow s = usual_window();
  TrackFactor factor(set);
  Solver solver(set);
  Supervisor supervisor;
  for (auto _ : state) {
    factor.collect(*s.window, {});
    benchmark::DoNotOptimize(solver.optimise(*s.window, factor, kSettings, supervisor));
  }
}

void marginalise(benchmark::State& state, int index) {
  InstructionSet set;
  if (!set_here(index, set)) return state.SkipWithError("not on this machine");
  const SyntheticWindow s = usual_window();
  TrackFactor factor(set);
  Marginaliser marginaliser(set);
  const auto work = std::make_unique<Window>(*s.window);
  for (auto _ : state) {
    state.PauseTiming();
    *work = *s.window;
    state.ResumeTiming();
    marginaliser.marginalise_oldest(*work, factor, {});
  }
}

void preintegrate_interval(benchmark::State& state) {
  Preintegration z;
  for (auto _ : state) {
    z.reset(Vec3::Zero(), Vec3::Zero());
    {
      Integration integration(z);
      for (int i = 0; i < 20; ++i)
        integration.step({0.1, 0.2, 0.3}, {0, 0, 9.8}, {0.1, 0.2, 0.31}, {0.1, 0, 9.8}, 0.005, {});
    }
    benchmark::DoNotOptimize(z);
  }
}

#define EPILINE_EACH_SET(f)                                       \
  BENCHMARK_CAPTURE(f, widest, 0)->Unit(benchmark::kMicrosecond); \
  BENCHMARK_CAPTURE(f, second, 1)->Unit(benchmark::kMicrosecond); \
  BENCHMARK_CAPTURE(f, third, 2)->Unit(benchmark::kMicrosecond)

EPILINE_EACH_SET(linearise_tracks);
EPILINE_EACH_SET(linearise_epipolar);
EPILINE_EACH_SET(linearise_reprojection);
EPILINE_EACH_SET(factorise);
EPILINE_EACH_SET(solve_window);
EPILINE_EACH_SET(marginalise);
BENCHMARK(preintegrate_interval)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace epiline
