// How much hangs on the constants that were tuned: flights with truth, flown with each of them smaller and larger.
// docs/developers/constants.md has the table and tells which flights it was made of.
#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <type_traits>
#include <variant>
#include <vector>

#include "drivers/study/replay/replay.h"
#include "drivers/study/report/flight_record.h"
#include "pipeline/config/config.h"
#include "platform/math/statistics.h"
#include "tests/flights/studies.h"

namespace epiline::sensitivity {
namespace {

struct Options {
  ReplayOptions replay;
  std::vector<std::filesystem::path> flights;
  std::vector<double> factors = {0.5, 1 / std::sqrt(2.), std::sqrt(2.), 2};
  std::string only;
};

/// A member of Config::estimator or Config::tracker. Some are settings as well, under the same name.
struct Constant {
  std::string name;
  std::variant<int EstimatorConfig::*, double EstimatorConfig::*, int TrackerConfig::*, float TrackerConfig::*> member;

  /// f(the member in `config`).
  template <class F>
  void visit(Config& config, F f) const {
    std::visit(
        [&]<class Owner, class Number>(Number Owner::*at) {
          if constexpr (std::is_same_v<Owner, EstimatorConfig>)
            f(config.estimator.*at);
          else
            f(config.tracker.*at);
        },
        member);
  }
};

std::vector<Constant> constants() {
  return {
      {"estimator.keyframes", &EstimatorConfig::keyframes},
      {"estimator.solve_interval_s", &EstimatorConfig::solve_interval_s},
      {"estimator.sigma_inflation", &EstimatorConfig::sigma_inflation},
      {"estimator.drift_inflation", &EstimatorConfig::drift_inflation},
      {"estimator.drift_student", &EstimatorConfig::drift_student},
      {"estimator.cauchy", &EstimatorConfig::cauchy},
      {"estimator.gate_cap", &EstimatorConfig::gate_cap},
      {"estimator.gyroscope_density_factor", &EstimatorConfig::gyroscope_density_factor},
      {"estimator.accelerometer_density_factor", &EstimatorConfig::accelerometer_density_factor},
      {"estimator.accelerometer_walk_factor", &EstimatorConfig::accelerometer_walk_factor},
      {"estimator.keyframe_parallax_px", &EstimatorConfig::keyframe_parallax_px},
      {"estimator.time_offset_sigma_s", &EstimatorConfig::time_offset_sigma_s},
      {"tracker.max_features", &TrackerConfig::max_features},
      {"tracker.iterations", &TrackerConfig::iterations},
      {"tracker.step_px", &TrackerConfig::step_px},
      {"tracker.coarse_step_px", &TrackerConfig::coarse_step_px},
      {"tracker.max_step_px", &TrackerConfig::max_step_px},
      {"tracker.min_eigenvalue", &TrackerConfig::min_eigenvalue},
      {"tracker.start_level_0_px", &TrackerConfig::start_level_0_px},
      {"tracker.start_level_1_px", &TrackerConfig::start_level_1_px},
      {"tracker.start_level_2_px", &TrackerConfig::start_level_2_px},
      {"tracker.min_correlation", &TrackerConfig::min_correlation},
      {"tracker.max_backward_px", &TrackerConfig::max_backward_px},
      {"tracker.hypotheses", &TrackerConfig::hypotheses},
      {"tracker.near_limit_px", &TrackerConfig::near_limit_px},
      {"tracker.wide_limit_px", &TrackerConfig::wide_limit_px},
      {"tracker.min_distance_px", &TrackerConfig::min_distance_px},
      {"tracker.min_score", &TrackerConfig::min_score},
      {"tracker.edge_share", &TrackerConfig::edge_share},
  };
}

struct Outcome {
  double ate_m = 0, tracking_s = 0;
};

/// Empty: it does not replay, or gives no trajectory.
std::optional<Outcome> fly(ReplayOptions options, const std::filesystem::path& flight) {
  options.dataset = flight;
  const auto result = replay(options, [](std::size_t, std::size_t) {});
  if (!result) return std::nullopt;
  const FlightRecord& record = result->record;
  const auto errors = errors_of(record);
  if (!errors || !(errors->ate_4dof.rmse > 0)) return std::nullopt;
  Outcome o{errors->ate_4dof.rmse, 0};
  for (std::size_t i = 1; i < record.images.size(); ++i)
    if (record.images[i].has_pose && record.images[i].health.state == HealthState::kTracking)
      o.tracking_s += (record.images[i].stamp - record.images[i - 1].stamp).seconds();
  return o;
}

void print(const Constant& c, double usual_value, double value, const std::vector<Outcome>& usual,
           const std::vector<std::optional<Outcome>>& changed, const std::vector<std::filesystem::path>& flights) {
  std::vector<double> ratios;
  double worst = 0, usual_s = 0, changed_s = 0;
  std::string worst_flight, failed;
  for (std::size_t i = 0; i < flights.size(); ++i) {
    usual_s += usual[i].tracking_s;
    if (!changed[i]) {
      failed += " " + flights[i].filename().string();
      continue;
    }
    changed_s += changed[i]->tracking_s;
    const double ratio = changed[i]->ate_m / usual[i].ate_m;
    ratios.push_back(ratio);
    if (ratio <= worst) continue;
    worst = ratio;
    worst_flight = flights[i].filename().string();
  }
  const std::string name = fmt::format("| {} | {:.4g} | {:.4g} |", c.name, usual_value, value);
  if (ratios.empty())
    fmt::print("{} no flight | | |\n", name);
  else
    fmt::print("{} {:.2f} | {:.2f} {} | {:+.1f} %{}{} |\n", name, summarise(ratios).median, worst, worst_flight,
               100 * (changed_s / usual_s - 1), failed.empty() ? "" : ", fails:", failed);
  std::fflush(stdout);
}

int run(Options& o) {
  std::vector<Outcome> usual;
  for (const auto& flight : o.flights) {
    const auto outcome = fly(o.replay, flight);
    if (!outcome) {
      fmt::print(stderr, "no data set with ground truth, or no trajectory: {}\n", flight.string());
      return 2;
    }
    fmt::print("{}: ATE {:.4f} m, tracking {:.1f} s\n", flight.filename().string(), outcome->ate_m,
               outcome->tracking_s);
    usual.push_back(*outcome);
  }
  fmt::print(
      "\n| constant | default | tried | error, times the usual: median | worst flight | time tracking |\n"
      "|---|---|---|---|---|---|\n");
  for (const Constant& c : constants()) {
    if (c.name.find(o.only) == std::string::npos) continue;
    for (const double factor : o.factors) {
      double before = 0, value = 0;
      o.replay.tune = [&](Config& config) {
        c.visit(config, [&]<class Number>(Number& number) {
          before = static_cast<double>(number);
          number = static_cast<Number>(std::is_integral_v<Number> ? std::round(factor * before) : factor * before);
          value = static_cast<double>(number);
        });
      };
      std::vector<std::optional<Outcome>> changed;
      for (const auto& flight : o.flights) changed.push_back(fly(o.replay, flight));
      print(c, before, value, usual, changed, o.flights);
    }
  }
  return 0;
}

std::function<int()> add(CLI::App& app) {
  static Options o;
  app.add_option("DATASETS", o.flights)->required();
  app.add_option("--factors", o.factors, "on each constant's default, one after the other");
  app.add_option("--only", o.only, "constants with this in their name");
  app.add_option("--start", o.replay.start_s, "s of each flight left out at the beginning");
  app.add_option("--duration", o.replay.duration_s, "s of each flight");
  return [] { return run(o); };
}
const StudyEntry kEntry("sensitivity", "What the tuned constants change in flights with ground truth", add);

}  // namespace
}  // namespace epiline::sensitivity
