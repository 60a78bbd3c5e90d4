#include "drivers/study/montecarlo/study.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <mutex>
#include <sstream>
#include <thread>

#include "pipeline/config/config.h"

#include "platform/linux/end_request.h"

namespace epiline {

const char* const kVariantChanges =
    "gate, no-gate, zero-motion, no-zero-motion, raw-parallax, compensated-parallax, middle-row, estimate-sigma, "
    "shipped, "
    "steps=N, keyframes=N";

namespace {

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
  } else if (key == "middle-row") {  // every row of a rolling shutter is taken for the middle one
    config.extrinsics.readout_s = 0;
  } else if (key == "estimate-sigma") {
    config.estimate_pixel_sigma = true;
  } else if (key == "shipped") {  // the defaults, which allow for an imperfect IMU and correlated tracks
    const EstimatorConfig defaults;
    config.sigma_inflation = defaults.sigma_inflation;
    config.track_noise = defaults.track_noise;
    config.gyroscope_density_factor = defaults.gyroscope_density_factor;
    config.accelerometer_density_factor = defaults.accelerometer_density_factor;
    config.accelerometer_walk_factor = defaults.accelerometer_walk_factor;
    config.estimate_pixel_sigma = defaults.estimate_pixel_sigma;
    config.estimate_time_offset = defaults.estimate_time_offset;
  } else if (key == "steps" && value > 0) {
    config.steps = config.steps_young = value;
  } else if (key == "keyframes" && value >= 2 && value <= 20) {
    config.keyframes = value;
  } else {
    return false;
  }
  return true;
}

EstimatorConfig config_of(const FactorVariant& variant, const TrackSimulation& simulation,
                          const StudyOptions& options) {
  EstimatorConfig config = comparison_config(variant.factor, simulation);
  if (options.assumed_sigma_px) config.pixel_sigma = *options.assumed_sigma_px;
  if (options.time_offset_s != 0) {
    config.estimate_time_offset = true;
    config.extrinsics.time_offset_s = 0;
  }
  for (const std::string& what : variant.changes) change(what, config);
  return config;
}

/// The threads and what they share.
class Study {
 public:
  Study(const StudyOptions& options, const std::function<void(std::size_t, std::size_t)>& progress)
      : options_(options),
        progress_(progress),
        runs_(static_cast<std::size_t>(options.runs)),
        flown_(options.flights.size() * runs_) {
    for (const FlightKind flight : options_.flights)
      for (const FactorVariant& variant : options_.variants)
        cells_.push_back({flight, variant.name, std::vector<RunFigures>(runs_)});
  }

  std::vector<StudyCell> run() {
    std::vector<std::thread> threads;
    for (int i = 0; i < options_.jobs; ++i) threads.emplace_back([this] { work(); });
    for (std::thread& thread : threads) thread.join();
    if (EndRequest::is_made()) leave_out_unflown();
    return std::move(cells_);
  }

 private:
  void work() {
    const std::size_t all = options_.flights.size() * runs_;
    for (std::size_t job = next_++; job < all; job = next_++) {
      fly(job / runs_, job % runs_);
      if (EndRequest::is_made()) return;  // this flight may have been cut
      flown_[job] = 1;
      const std::lock_guard lock(progress_mutex_);
      progress_(++done_, all);
    }
  }

  void fly(std::size_t flight_index, std::size_t run) {
    TrackSimulation simulation;
    simulation.flight = options_.flights[flight_index];
    simulation.seed = options_.seed + run;
    simulation.noise = options_.noise;
    simulation.time_offset_s = options_.time_offset_s;
    simulation.readout_s = options_.readout_s;
    SimulatedFlight flight = simulate_tracks(simulation);
    add_correlated_noise(options_.correlated, simulation.seed, flight);
    for (std::size_t v = 0; v < options_.variants.size(); ++v) {
      const EstimatorConfig config = config_of(options_.variants[v], simulation, options_);
      cells_[flight_index * options_.variants.size() + v].runs[run] = run_simulated(flight, config, simulation.seed);
    }
  }

  void leave_out_unflown() {
    std::vector<StudyCell> cells;
    for (std::size_t c = 0; c < cells_.size(); ++c) {
      StudyCell flown{cells_[c].flight, cells_[c].variant, {}};
      for (std::size_t r = 0; r < runs_; ++r)
        if (flown_[c / options_.variants.size() * runs_ + r] != 0) flown.runs.push_back(std::move(cells_[c].runs[r]));
      if (!flown.runs.empty()) cells.push_back(std::move(flown));
    }
    cells_ = std::move(cells);
  }

  const StudyOptions& options_;
  const std::function<void(std::size_t, std::size_t)>& progress_;
  std::size_t runs_;
  std::vector<char> flown_;  ///< of each flight and seed; bytes, for several threads write
  std::vector<StudyCell> cells_;
  std::atomic<std::size_t> next_ = 0;
  std::mutex progress_mutex_;
  std::size_t done_ = 0;
};

void append(const std::vector<double>& from, std::vector<double>& to) { to.insert(to.end(), from.begin(), from.end()); }

}  // namespace

Result<FactorVariant> parse_variant(const std::string& text) {
  std::stringstream stream(text);
  std::string part;
  std::getline(stream, part, ':');
  const auto factor = visual_factor_from(part);
  if (!factor) {
    std::string names;
    for (const char* name : kVisualFactorNames) names.append(names.empty() ? "" : ", ").append(name);
    return Error{ErrorKind::kUsage, "--factors", 0, "no visual factor is called \"" + part + "\"", "one of " + names};
  }
  FactorVariant variant{text, *factor, {}};
  while (std::getline(stream, part, ':')) {
    EstimatorConfig scratch;
    if (!change(part, scratch))
      return Error{ErrorKind::kUsage, "--factors", 0, "unknown change \"" + part + "\"", kVariantChanges};
    variant.changes.push_back(part);
  }
  return variant;
}

std::vector<StudyCell> run_study(const StudyOptions& options,
                                 const std::function<void(std::size_t, std::size_t)>& progress) {
  return Study(options, progress).run();
}

StudySummary summary_of(const StudyCell& cell) {
  StudySummary s;
  std::vector<double> ate, rpe, scale_abs, yaw, nees_position, nees_rotation, time_offset, solve, marginalise, estimate;
  for (const RunFigures& r : cell.runs) {
    ++s.runs;
    append(r.solve_ms, solve);
    append(r.marginalise_ms, marginalise);
    append(r.estimate_ms, estimate);
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
  s.ate = summarise(std::move(ate));
  s.rpe = summarise(std::move(rpe));
  s.scale_abs = summarise(std::move(scale_abs));
  s.yaw = summarise(std::move(yaw));
  s.nees_position = summarise(std::move(nees_position));
  s.nees_rotation = summarise(std::move(nees_rotation));
  s.time_offset = summarise(std::move(time_offset));
  s.solve_ms = summarise(std::move(solve));
  s.marginalise_ms = summarise(std::move(marginalise));
  s.estimate_ms = summarise(std::move(estimate));
  return s;
}

}  // namespace epiline
