// Many simulated flights: the errors of each visual factor, and whether its covariance tells the truth about them.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "pipeline/evaluate/statistics.h"
#include "tests/flights/simulated_run.h"

namespace epiline {
namespace {

struct Options {
  std::vector<std::string> flights, factors{"track", "epipolar"};
  int runs = 10, jobs = 1;
  std::uint64_t seed = 1;
  TrackNoise noise{.pixel_sigma = 1, .outlier_share = 0.02, .drift_px = 0};
  std::optional<double> assumed_sigma;
  double time_offset_s = 0;
  std::filesystem::path out;
};

/// A factor and what is changed about it: `track`, `epipolar:gate:zero-motion`, `track:steps=5`.
struct Variant {
  std::string name;
  VisualFactor factor = VisualFactor::kTrack;
  std::vector<std::string> changes;
};

constexpr const char* kChangesHelp =
    "gate, no-gate, zero-motion, no-zero-motion, raw-parallax, compensated-parallax, estimate-sigma, shipped, steps=N, "
    "keyframes=N";

bool change(const std::string& what, EstimatorConfig& config) {
  const std::size_t equals = what.find('=');
  const std::string key = what.substr(0, equals);
  const int value = equals == std::string::npos ? 0 : std::atoi(what.c_str() + equals + 1);
  if (key == "gate" || key == "no-gate") {
    config.gate = key == "gate";
  } else if (key == "zero-motion" || key == "no-zero-motion") {
    config.zero_motion = key == "zero-motion";
  } else if (key == "raw-parallax") {
    config.keyframe_rule = KeyframeRule::kRawParallax;
  } else if (key == "compensated-parallax") {
    config.keyframe_rule = KeyframeRule::kCompensatedParallax;
  } else if (key == "estimate-sigma") {
    config.estimate_pixel_sigma = true;
  } else if (key == "shipped") {  // the defaults, which allow for an imperfect IMU and correlated tracks
    const EstimatorConfig defaults;
    config.sigma_inflation = defaults.sigma_inflation;
    config.gyroscope_density_factor = defaults.gyroscope_density_factor;
    config.accelerometer_density_factor = defaults.accelerometer_density_factor;
    config.estimate_pixel_sigma = defaults.estimate_pixel_sigma;
    config.estimate_time_offset = defaults.estimate_time_offset;
  } else if (key == "steps" && value > 0) {
    config.steps = config.steps_young = value;
  } else if (key == "keyframes" && value > 0) {
    config.keyframes = value;
  } else {
    return false;
  }
  return true;
}

std::optional<Variant> variant_from(const std::string& text) {
  Variant variant{.name = text, .changes = {}};
  std::stringstream stream(text);
  std::string part;
  std::getline(stream, part, ':');
  if (part == "epipolar") {
    variant.factor = VisualFactor::kEpipolar;
  } else if (part == "reprojection") {
    variant.factor = VisualFactor::kReprojection;
  } else if (part != "track") {
    return std::nullopt;
  }
  while (std::getline(stream, part, ':')) {
    EstimatorConfig scratch;
    if (!change(part, scratch)) return std::nullopt;
    variant.changes.push_back(part);
  }
  return variant;
}

EstimatorConfig config_of(const Variant& variant, const TrackSimulation& simulation, const Options& options) {
  EstimatorConfig config = comparison_config(variant.factor, simulation);
  if (options.assumed_sigma) config.pixel_sigma = *options.assumed_sigma;
  if (options.time_offset_s != 0) {
    config.estimate_time_offset = true;
    config.extrinsics.time_offset_s = 0;
  }
  for (const std::string& what : variant.changes) change(what, config);
  return config;
}

/// All runs of one flight with one variant.
struct Cell {
  FlightKind flight;
  const Variant* variant;
  std::vector<RunFigures> runs;
};

/// The figures of a cell; of the runs that did not diverge, but for the times.
struct CellSummary {
  int diverged = 0, runs = 0;
  Summary ate, rpe, scale_abs, yaw, nees_position, nees_rotation, time_offset;
  double scale_mean = 0;
  Summary solve_ms, marginalise_ms, estimate_ms;
};

CellSummary summary_of(const Cell& cell) {
  CellSummary s;
  std::vector<double> ate, rpe, scale_abs, yaw, nees_position, nees_rotation, time_offset, solve, marginalise, estimate;
  const auto append = [](std::vector<double>& to, const std::vector<double>& from) {
    to.insert(to.end(), from.begin(), from.end());
  };
  for (const RunFigures& r : cell.runs) {
    ++s.runs;
    append(solve, r.solve_ms);
    append(marginalise, r.marginalise_ms);
    append(estimate, r.estimate_ms);
    if (r.diverged) {
      ++s.diverged;
      continue;
    }
    ate.push_back(r.ate_m);
    rpe.push_back(r.rpe_5s_m);
    scale_abs.push_back(std::abs(r.scale_error));
    s.scale_mean += r.scale_error;
    yaw.push_back(r.yaw_end_deg);
    nees_position.push_back(r.nees_position);
    nees_rotation.push_back(r.nees_rotation);
    time_offset.push_back(std::abs(r.time_offset_error_s));
  }
  s.scale_mean /= std::max(1, s.runs - s.diverged);
  s.ate = summarise(ate);
  s.rpe = summarise(rpe);
  s.scale_abs = summarise(scale_abs);
  s.yaw = summarise(yaw);
  s.nees_position = summarise(nees_position);
  s.nees_rotation = summarise(nees_rotation);
  s.time_offset = summarise(time_offset);
  s.solve_ms = summarise(solve);
  s.marginalise_ms = summarise(marginalise);
  s.estimate_ms = summarise(estimate);
  return s;
}

/// Simulates each flight once and gives it to every variant: the factors see the very same noise.
class Study {
 public:
  Study(const Options& options, const std::vector<FlightKind>& flights, const std::vector<Variant>& variants)
      : options_(options), flights_(flights), variants_(variants) {
    for (const FlightKind flight : flights_)
      for (const Variant& variant : variants_)
        cells_.push_back({flight, &variant, std::vector<RunFigures>(static_cast<std::size_t>(options_.runs))});
  }

  const std::vector<Cell>& run() {
    std::vector<std::thread> threads;
    for (int i = 0; i < options_.jobs; ++i) threads.emplace_back([this] { work(); });
    for (std::thread& thread : threads) thread.join();
    if (show_progress_) fmt::print(stderr, "\r{:30}\r", "");
    return cells_;
  }

 private:
  void work() {
    const std::size_t runs = static_cast<std::size_t>(options_.runs), total = flights_.size() * runs;
    for (std::size_t job = next_++; job < total; job = next_++) {
      TrackSimulation simulation;
      simulation.flight = flights_[job / runs];
      simulation.seed = options_.seed + job % runs;
      simulation.noise = options_.noise;
      simulation.time_offset_s = options_.time_offset_s;
      const SimulatedFlight flight = simulate_tracks(simulation);
      for (std::size_t v = 0; v < variants_.size(); ++v) {
        const EstimatorConfig config = config_of(variants_[v], simulation, options_);
        cells_[job / runs * variants_.size() + v].runs[job % runs] = run_simulated(flight, config, simulation.seed);
      }
      const std::size_t done = ++done_;
      if (show_progress_) fmt::print(stderr, "\rflight {} of {}", done, total);
    }
  }

  const Options& options_;
  const std::vector<FlightKind>& flights_;
  const std::vector<Variant>& variants_;
  std::vector<Cell> cells_;
  std::atomic<std::size_t> next_ = 0, done_ = 0;
  bool show_progress_ = isatty(STDERR_FILENO) == 1;
};

/// Figures of the runs that did not diverge; dashes if there is none.
std::string error_columns(const CellSummary& s) {
  if (s.ate.count == 0) return fmt::format("{:>15} {:>7} {:>14} {:>7} {:>19} {:>19}", "-", "-", "-", "-", "-", "-");
  return fmt::format(
      "{:>6.3f} ({:>6.3f}) {:>7.3f} {:>5.2f} ({:>+6.2f}) {:>7.2f} {:>9.2f} ({:>7.2f}) {:>9.2f} ({:>7.2f})", s.ate.rmse,
      s.ate.median, s.rpe.rmse, 100 * s.scale_abs.mean, 100 * s.scale_mean, s.yaw.mean, s.nees_position.mean,
      s.nees_position.median, s.nees_rotation.mean, s.nees_rotation.median);
}

std::string table(const std::vector<Cell>& cells, const Options& options) {
  std::string text = fmt::format(
      "{} runs, seed {}, {} px white noise, {} % outliers, {} px drift per root of an image, time offset {} ms\n"
      "ATE: rms over the runs that did not diverge, of each run's rms after alignment in yaw and translation. "
      "NEES: per degree of freedom, 1 is ideal.\n\n",
      options.runs, options.seed, options.noise.pixel_sigma, 100 * options.noise.outlier_share, options.noise.drift_px,
      1e3 * options.time_offset_s);
  text += fmt::format("{:<9} {:<24} {:>15} {:>7} {:>14} {:>7} {:>19} {:>19} {:>7} {:>12} {:>12} {:>7}\n", "flight",
                      "factor", "ATE m (median)", "RPE 5s", "scale % (mean)", "yaw deg", "NEES pos (median)",
                      "NEES rot (median)", "div", "solve ms/p99", "estim ms/p99", "td ms");
  for (const Cell& cell : cells) {
    const CellSummary s = summary_of(cell);
    text +=
        fmt::format("{:<9} {:<24} {} {:>7} {:>5.2f} /{:>5.2f} {:>5.2f} /{:>5.2f} {:>7.3f}\n", to_string(cell.flight),
                    cell.variant->name, error_columns(s), fmt::format("{}/{}", s.diverged, s.runs), s.solve_ms.mean,
                    s.solve_ms.p99, s.estimate_ms.mean, s.estimate_ms.p99, 1e3 * s.time_offset.rmse);
  }
  return text;
}

using Json = nlohmann::ordered_json;

Json times(const Summary& s) { return {{"mean", s.mean}, {"p50", s.median}, {"p99", s.p99}, {"max", s.max}}; }

Json run_json(const RunFigures& r) {
  return {{"diverged", r.diverged},
          {"diverged_at_s", r.diverged ? Json(r.diverged_at_s) : Json(nullptr)},
          {"ate_m", r.ate_m},
          {"rpe_5s_m", r.rpe_5s_m},
          {"scale_error", r.scale_error},
          {"yaw_end_deg", r.yaw_end_deg},
          {"nees_position", r.nees_position},
          {"nees_rotation", r.nees_rotation},
          {"time_offset_error_s", r.time_offset_error_s}};
}

/// Null where every run diverged.
Json errors_json(const CellSummary& s) {
  if (s.ate.count == 0) return nullptr;
  return {{"ate_m", {{"rms", s.ate.rmse}, {"median", s.ate.median}}},
          {"rpe_5s_m", s.rpe.rmse},
          {"scale_error", {{"mean_abs", s.scale_abs.mean}, {"mean", s.scale_mean}}},
          {"yaw_end_deg", s.yaw.mean},
          {"nees_position", {{"mean", s.nees_position.mean}, {"median", s.nees_position.median}}},
          {"nees_rotation", {{"mean", s.nees_rotation.mean}, {"median", s.nees_rotation.median}}},
          {"time_offset_error_rms_s", s.time_offset.rmse}};
}

Json cell_json(const Cell& cell) {
  const CellSummary s = summary_of(cell);
  Json runs = Json::array();
  for (const RunFigures& r : cell.runs) runs.push_back(run_json(r));
  return {
      {"flight", to_string(cell.flight)},
      {"factor", cell.variant->name},
      {"diverged", s.diverged},
      {"errors", errors_json(s)},
      {"timing_ms",
       {{"solve", times(s.solve_ms)}, {"marginalise", times(s.marginalise_ms)}, {"estimate", times(s.estimate_ms)}}},
      {"runs", runs}};
}

Json document(const std::vector<Cell>& cells, const Options& options) {
  Json list = Json::array();
  for (const Cell& cell : cells) list.push_back(cell_json(cell));
  return {{"schema", 1},
          {"settings",
           {{"runs", options.runs},
            {"seed", options.seed},
            {"pixel_noise_px", options.noise.pixel_sigma},
            {"outlier_share", options.noise.outlier_share},
            {"drift_px", options.noise.drift_px},
            {"assumed_sigma_px", options.assumed_sigma ? Json(*options.assumed_sigma) : Json(nullptr)},
            {"time_offset_s", options.time_offset_s}}},
          {"results", list}};
}

int usage_error(const std::string& what) {
  fmt::print(stderr, "epiline: error: {}\n", what);
  return 2;
}

int run(const Options& options) {
  std::vector<FlightKind> flights;
  for (const std::string& name : options.flights) {
    const std::optional<FlightKind> flight = flight_from(name);
    if (!flight) return usage_error(fmt::format("--flight: no flight is called '{}'", name));
    flights.push_back(*flight);
  }
  if (flights.empty()) flights.assign(kAllFlights.begin(), kAllFlights.end());
  std::vector<Variant> variants;
  for (const std::string& name : options.factors) {
    const std::optional<Variant> variant = variant_from(name);
    if (!variant)
      return usage_error(fmt::format("--factors: '{}'; expected track or epipolar[:{}]", name, kChangesHelp));
    variants.push_back(*variant);
  }
  Study study(options, flights, variants);
  const std::vector<Cell>& cells = study.run();
  const std::string text = table(cells, options);
  fmt::print("{}", text);
  if (options.out.empty()) return 0;
  std::error_code error;
  std::filesystem::create_directories(options.out, error);
  std::ofstream txt(options.out / "montecarlo.txt"), json(options.out / "montecarlo.json");
  txt << text;
  json << document(cells, options).dump(1) << '\n';
  return txt.flush() && json.flush() ? 0 : usage_error(fmt::format("{}: cannot be written", options.out.string()));
}

}  // namespace
}  // namespace epiline

int main(int argc, char** argv) {
  epiline::Options options;
  CLI::App app("Many simulated flights through the estimator: errors, and whether the covariance tells the truth.",
               "montecarlo");
  app.add_option("--flight", options.flights,
                 "agile, hall, hover, still, straight, corridor, purerot, standstill, rover (all)")
      ->delimiter(',');
  app.add_option(
         "--factors", options.factors,
         std::string("track, epipolar (as in the paper); each with changes behind colons: ") + epiline::kChangesHelp)
      ->delimiter(',')
      ->capture_default_str();
  app.add_option("--runs", options.runs, "runs of each flight")->check(CLI::Range(1, 1'000'000))->capture_default_str();
  app.add_option("--pixel-noise", options.noise.pixel_sigma, "white noise of the tracks, px")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app.add_option("--assumed-sigma", options.assumed_sigma, "what the estimator is told instead, px")
      ->check(CLI::PositiveNumber);
  app.add_option("--outliers", options.noise.outlier_share, "share of outliers")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  app.add_option("--drift", options.noise.drift_px, "random walk of the tracks, px per root of an image")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app.add_option("--time-offset", options.time_offset_s,
                 "image stamps are too early by this, s; the estimator is not told and has to find it");
  app.add_option("--seed", options.seed, "of the first run")->capture_default_str();
  app.add_option("--jobs", options.jobs, "threads")->check(CLI::Range(1, 256))->capture_default_str();
  app.add_option("--out", options.out, "folder for montecarlo.txt and montecarlo.json");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  return epiline::run(options);
}
