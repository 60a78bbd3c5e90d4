// Stages of the window solver on a window of the usual size (11 frames, about 290 tracks), each instruction set this
// machine has; the slowest set is the yardstick in the same run.
#include <benchmark/benchmark.h>

#include <cstring>

#include "estimator/factors/epipolar.h"
#include "estimator/factors/reprojection.h"
#include "estimator/factors/track.h"
#include "estimator/window/marginalise.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline {
namespace {

constexpr SolverSettings kSettings{.steps = 1, .estimate_time_offset = true, .estimate_extrinsics = false};

SyntheticWindow usual_window() {
  SyntheticWindow s = make_window({.frames = 11, .tracks = 290, .pixel_noise = 0.5});
  CalibrationTangent sigmas = CalibrationTangent::Constant(5e-3);
  set_initial_prior(*s.window, {}, sigmas);
  return s;
}

void linearise_tracks(benchmark::State& state, const char* name) {
  const Kernels* k = kernels_named(name);
  if (!k) return state.SkipWithError("not on this machine");
  SyntheticWindow s = usual_window();
  TrackFactor factor(*k);
  const auto system = std::make_unique<VisualSystem>();
  factor.collect(*s.window, {});
  for (auto _ : state) factor.linearise(*s.window, *system);
  state.counters["tracks"] = system->tracks;
  state.counters["constraints"] = system->residuals;
}

void linearise_epipolar(benchmark::State& state) {
  SyntheticWindow s = usual_window();
  EpipolarFactor factor;
  const auto system = std::make_unique<VisualSystem>();
  factor.collect(*s.window, {});
  for (auto _ : state) factor.linearise(*s.window, *system);
}

void linearise_reprojection(benchmark::State& state, const char* name) {
  const Kernels* k = kernels_named(name);
  if (!k) return state.SkipWithError("not on this machine");
  SyntheticWindow s = usual_window();
  ReprojectionFactor factor(*k);
  const auto system = std::make_unique<VisualSystem>();
  factor.collect(*s.window, {});
  for (auto _ : state) factor.linearise(*s.window, *system);
  state.counters["landmarks"] = factor.unknowns();
}

void factorise(benchmark::State& state, const char* name) {
  const Kernels* k = kernels_named(name);
  if (!k) return state.SkipWithError("not on this machine");
  SyntheticWindow s = usual_window();
  TrackFactor factor(*k);
  Solver solver(*k);
  factor.collect(*s.window, {});
  solver.linearise(*s.window, factor, kSettings);
  const auto keep = std::make_unique<LinearSystem>(solver.system());
  const auto work = std::make_unique<LinearSystem>();
  for (auto _ : state) {
    std::memcpy(work.get(), keep.get(), sizeof *work);  // in place: the copy is part of the figure
    benchmark::DoNotOptimize(k->factorise(*work, 0));
  }
}

void solve_window(benchmark::State& state, const char* name) {
  const Kernels* k = kernels_named(name);
  if (!k) return state.SkipWithError("not on this machine");
  SyntheticWindow s = usual_window();
  TrackFactor factor(*k);
  Solver solver(*k);
  Supervisor supervisor;
  for (auto _ : state) {
    factor.collect(*s.window, {});
    benchmark::DoNotOptimize(solver.optimise(*s.window, factor, kSettings, supervisor));
  }
}

void marginalise(benchmark::State& state, const char* name) {
  const Kernels* k = kernels_named(name);
  if (!k) return state.SkipWithError("not on this machine");
  const SyntheticWindow s = usual_window();
  TrackFactor factor(*k);
  Marginaliser marginaliser(*k);
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
    for (int i = 0; i < 20; ++i) z.integrate({0.1, 0.2, 0.3}, {0, 0, 9.8}, {0.1, 0.2, 0.31}, {0.1, 0, 9.8}, 0.005, {});
    benchmark::DoNotOptimize(z);
  }
}

#define EPILINE_EACH_SET(f)                                              \
  BENCHMARK_CAPTURE(f, avx512, "avx512")->Unit(benchmark::kMicrosecond); \
  BENCHMARK_CAPTURE(f, avx2, "avx2")->Unit(benchmark::kMicrosecond);     \
  BENCHMARK_CAPTURE(f, sse, "sse")->Unit(benchmark::kMicrosecond);       \
  BENCHMARK_CAPTURE(f, neon, "neon")->Unit(benchmark::kMicrosecond)

EPILINE_EACH_SET(linearise_tracks);
BENCHMARK(linearise_epipolar)->Unit(benchmark::kMicrosecond);
EPILINE_EACH_SET(linearise_reprojection);
EPILINE_EACH_SET(factorise);
EPILINE_EACH_SET(solve_window);
EPILINE_EACH_SET(marginalise);
BENCHMARK(preintegrate_interval)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace epiline
