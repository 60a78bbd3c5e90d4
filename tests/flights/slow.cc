// Slow vehicles: what the estimator makes of a minute at some millimetres a second, or at rest. One row for each depth
// and speed, one column for each noise of the tracks.
#include <fmt/format.h>

#include <cstdio>
#include <vector>

#include "tests/flights/slow_run.h"
#include "tests/flights/studies.h"

namespace epiline::slow {
namespace {

struct Options {
  test::SlowFlight flight;
  std::vector<double> depths{3, 5, 10, 30, 50}, speeds{0, 0.001, 0.003, 0.01, 0.02}, noises{0.03, 0.3, 1};
  int seeds = 1;
  bool without_rest = false;
};

int run(const Options& o) {
  test::SlowFlight flight = o.flight;
  EstimatorConfig config;
  config.zero_motion = !o.without_rest;
  double worst = 0;
  for (const auto error : {test::TrackError::kWhite, test::TrackError::kDrift}) {
    fmt::print("\n{} errors; error at the end / sigma, m (largest ratio), share at rest\n\n| D, m | mm/s |",
               error == test::TrackError::kWhite ? "white" : "drifting");
    for (const double noise : o.noises) fmt::print(" {} px |", noise);
    fmt::print("\n|---|---|");
    for ([[maybe_unused]] const double noise : o.noises) fmt::print("---|");
    for (const double depth : o.depths)
      for (const double speed : o.speeds) {
        fmt::print("\n| {} | {} |", depth, 1e3 * speed);
        for (const double noise : o.noises) {
          test::SlowVerdict shown;  // of all seeds the worst
          for (int seed = 1; seed <= o.seeds; ++seed) {
            flight.seed = static_cast<std::uint64_t>(seed);
            flight.depth_m = depth;
            flight.speed_m_s = speed;
            flight.noise_px = noise;
            flight.error = error;
            const test::SlowVerdict v = test::fly_slowly(flight, config);
            if (v.worst_ratio >= shown.worst_ratio) shown = v;
          }
          worst = std::max(worst, shown.worst_ratio);
          const char* mark = shown.worst_ratio > 3.5 ? "**" : "";
          fmt::print(" {}{:.3f}/{:.3f} ({:.1f}), {:.0f} %{}{} |", mark, shown.error_m, shown.sigma_m, shown.worst_ratio,
                     100 * shown.rest_share,
                     shown.tracking_share < 0.9 ? fmt::format(", tracking {:.0f} %", 100 * shown.tracking_share) : "",
                     mark);
          std::fflush(stdout);
        }
      }
    fmt::print("\n");
  }
  fmt::print("\nlargest ratio: {:.1f}\n", worst);
  return 0;
}

std::function<int()> add(CLI::App& app) {
  static Options o;
  app.add_option("--depth", o.depths, "m");
  app.add_option("--speed", o.speeds, "m/s");
  app.add_option("--noise", o.noises, "px");
  app.add_option("--direction", o.flight.direction_deg, "degrees from where the camera looks");
  app.add_option("--loss", o.flight.loss_share, "share of the tracks lost in each image");
  app.add_option("--slow", o.flight.slow_s, "s of slow motion");
  app.add_option("--seeds", o.seeds, "flights of each kind; the worst is shown");
  app.add_flag("--without-rest", o.without_rest, "without the zero-motion factor");
  return [] { return run(o); };
}
const StudyEntry kEntry("slow", "Simulated vehicles that stand or move very slowly after a lively flight", add);

}  // namespace
}  // namespace epiline::slow
