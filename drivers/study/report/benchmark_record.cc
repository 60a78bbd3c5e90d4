#include "drivers/study/report/benchmark_record.h"

#include <algorithm>
#include <cmath>

#include "drivers/study/evaluate/errors.h"
#include "platform/math/statistics.h"

namespace epiline {

namespace {

std::optional<double> number(const Json& value) {
  if (!value.is_number()) return std::nullopt;
  return value.get<double>();
}

/// The number at the pointer; none where the path breaks off or ends in something else.
std::optional<double> number_at(const Json& stats, const std::string& pointer) {
  const Json::json_pointer at(pointer);
  return stats.contains(at) ? number(stats.at(at)) : std::nullopt;
}

/// From the entry of a list that has this length.
std::optional<double> value_in(const Json& stats, const char* list, const char* length, double wanted,
                               const char* pointer) {
  const Json::json_pointer at(list);
  if (!stats.contains(at) || !stats.at(at).is_array()) return std::nullopt;
  for (const Json& entry : stats.at(at)) {
    if (number_at(entry, length) == wanted) return number_at(entry, pointer);
  }
  return std::nullopt;
}

std::optional<double> value_of(const BenchmarkFigure& figure, const Json& stats) {
  if (figure.rpe_distance_m > 0)
    return value_in(stats, "/error/rpe", "/distance_m", figure.rpe_distance_m, figure.pointer);
  if (figure.motion_s > 0) return value_in(stats, "/error/motion", "/seconds", figure.motion_s, figure.pointer);
  const std::optional<double> value = number_at(stats, figure.pointer);
  return value && figure.magnitude ? std::abs(*value) : value;
}

/// The measure of has_diverged(), on what stats.json tells.
bool run_diverged(const Json& stats) {
  const auto largest = number_at(stats, "/error/ate_4dof_m/max"), path = number_at(stats, "/error/path_length_m");
  return largest && path && has_diverged(*largest, *path);
}

bool same_poses(const Trajectory& a, const Trajectory& b) {
  const auto same = [](const TimedPose& x, const TimedPose& y) {
    return x.stamp == y.stamp && x.p_WB == y.p_WB && x.q_WB.coeffs() == y.q_WB.coeffs();
  };
  return std::equal(a.poses.begin(), a.poses.end(), b.poses.begin(), b.poses.end(), same);
}

void add_run(const BenchmarkRun& run, BenchmarkCell& cell) {
  if (cell.runs++ == 0) cell.folder = run.folder;
  if (run.outcome != RunOutcome::kDone) {
    if (cell.outcome == RunOutcome::kDone) {
      cell.outcome = run.outcome;
      cell.message = run.message;
    }
    return;
  }
  if (cell.done++ == 0) cell.estimate = &run.estimate;
  cell.diverged = cell.diverged || run_diverged(run.stats);
  cell.identical = cell.identical && same_poses(*cell.estimate, run.estimate);
  cell.curves = pooled(cell.curves, curves_of(run.stats));
}

}  // namespace

const char* to_string(RunOutcome outcome) {
  switch (outcome) {
    case RunOutcome::kDone:
      return "done";
    case RunOutcome::kNeverStarted:
      return "never started";
    case RunOutcome::kRefused:
      return "refused";
    case RunOutcome::kFailed:
      break;
  }
  return "failed";
}

const std::vector<BenchmarkFigure>& benchmark_figures() {
  static const std::vector<BenchmarkFigure> figures = {{"ate_4dof_m", "/error/ate_4dof_m/rmse"},
                                                       {"ate_4dof_max_m", "/error/ate_4dof_m/max"},
                                                       {"ate_se3_m", "/error/ate_se3_m/rmse"},
                                                       {"ate_sim3_m", "/error/ate_sim3_m/rmse"},
                                                       {"scale_error_abs", "/error/scale_error", 0, true},
                                                       {"rpe_1m_percent", "/translation_percent", 1},
                                                       {"rpe_1m_deg", "/rotation_deg", 1},
                                                       {"rpe_10m_percent", "/translation_percent", 10},
                                                       {"rpe_10m_deg", "/rotation_deg", 10},
                                                       {"motion_1s_m", "/translation_m/rmse", 0, false, 1},
                                                       {"motion_1s_deg", "/rotation_deg/rmse", 0, false, 1},
                                                       {"motion_5s_m", "/translation_m/rmse", 0, false, 5},
                                                       {"motion_5s_deg", "/rotation_deg/rmse", 0, false, 5},
                                                       {"motion_20s_m", "/translation_m/rmse", 0, false, 20},
                                                       {"motion_20s_deg", "/rotation_deg/rmse", 0, false, 20},
                                                       {"yaw_drift_abs_deg", "/error/yaw_drift_deg", 0, true},
                                                       {"nees_position", "/error/nees_position"},
                                                       {"nees_yaw", "/error/nees_yaw"},
                                                       {"nees_tilt", "/error/nees_tilt"},
                                                       {"nees_velocity", "/error/nees_velocity"},
                                                       {"start_s", "/initialisation/seconds_after_first_image"},
                                                       {"coverage", "/error/coverage"},
                                                       {"resets", "/resets"},
                                                       {"degraded_s", "/state_seconds/degraded"},
                                                       {"lost_s", "/state_seconds/lost"},
                                                       {"track_ms_mean", "/timing_ms/track/mean"},
                                                       {"track_ms_p50", "/timing_ms/track/p50"},
                                                       {"track_ms_p99", "/timing_ms/track/p99"},
                                                       {"track_ms_max", "/timing_ms/track/max"},
                                                       {"solve_ms_mean", "/timing_ms/solve/mean"},
                                                       {"solve_ms_p50", "/timing_ms/solve/p50"},
                                                       {"solve_ms_p99", "/timing_ms/solve/p99"},
                                                       {"solve_ms_max", "/timing_ms/solve/max"},
                                                       {"marginalise_ms_mean", "/timing_ms/marginalise/mean"},
                                                       {"estimate_ms_mean", "/timing_ms/estimate/mean"},
                                                       {"estimate_ms_p50", "/timing_ms/estimate/p50"},
                                                       {"estimate_ms_p99", "/timing_ms/estimate/p99"},
                                                       {"estimate_ms_max", "/timing_ms/estimate/max"},
                                                       {"track_cpu_ms_mean", "/cpu_ms/track/mean"},
                                                       {"track_cpu_ms_p50", "/cpu_ms/track/p50"},
                                                       {"track_cpu_ms_p99", "/cpu_ms/track/p99"},
                                                       {"track_cpu_ms_max", "/cpu_ms/track/max"},
                                                       {"solve_cpu_ms_mean", "/cpu_ms/solve/mean"},
                                                       {"solve_cpu_ms_p50", "/cpu_ms/solve/p50"},
                                                       {"solve_cpu_ms_p99", "/cpu_ms/solve/p99"},
                                                       {"solve_cpu_ms_max", "/cpu_ms/solve/max"},
                                                       {"marginalise_cpu_ms_mean", "/cpu_ms/marginalise/mean"},
                                                       {"estimate_cpu_ms_mean", "/cpu_ms/estimate/mean"},
                                                       {"estimate_cpu_ms_p50", "/cpu_ms/estimate/p50"},
                                                       {"estimate_cpu_ms_p99", "/cpu_ms/estimate/p99"},
                                                       {"estimate_cpu_ms_max", "/cpu_ms/estimate/max"},
                                                       {"iterations_mean", "/solver/iterations_mean"},
                                                       {"residuals_mean", "/solver/residuals_mean"},
                                                       {"state_size_mean", "/solver/state_size_mean"},
                                                       {"tracks_mean", "/tracks/per_image_mean"},
                                                       {"peak_rss_mib", "/memory/peak_rss_mib"}};
  return figures;
}

FigureSpread spread_of(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return {quantile(values, 0.5), quantile(values, 0.25), quantile(values, 0.75), values.front(), values.back()};
}

std::optional<double> BenchmarkCell::figure(const std::string& key) const {
  const auto found = spreads.find(key);
  if (found == spreads.end()) return std::nullopt;
  return found->second.median;
}

std::vector<BenchmarkCell> cells_of(const BenchmarkRecord& record) {
  const std::size_t factors = record.factors.size();
  std::vector<BenchmarkCell> cells(record.datasets.size() * factors);
  std::vector<std::map<std::string, std::vector<double>>> values(cells.size());
  for (const BenchmarkRun& run : record.runs) {
    const std::size_t at = run.dataset * factors + run.factor;
    add_run(run, cells[at]);
    if (run.outcome != RunOutcome::kDone) continue;
    for (const BenchmarkFigure& figure : benchmark_figures()) {
      if (const auto value = value_of(figure, run.stats)) values[at][figure.key].push_back(*value);
    }
  }
  for (std::size_t at = 0; at < cells.size(); ++at) {
    for (auto& [key, list] : values[at]) cells[at].spreads[key] = spread_of(std::move(list));
  }
  return cells;
}

BenchmarkSummary::BenchmarkSummary(const BenchmarkRecord& record) : record_(record), cells_(cells_of(record)) {
  const auto track = std::find(record.factors.begin(), record.factors.end(), "track");
  if (track != record.factors.end()) baseline_ = static_cast<std::size_t>(track - record.factors.begin());
}

BenchmarkRatio BenchmarkSummary::ratio(std::size_t factor, const std::string& key) const {
  std::vector<double> ratios;
  for (std::size_t d = 0; d < record_.datasets.size(); ++d) {
    const auto value = cell(d, factor).figure(key), reference = cell(d, baseline_).figure(key);
    if (value && reference && *reference > 0) ratios.push_back(*value / *reference);
  }
  if (ratios.empty()) return {};
  std::sort(ratios.begin(), ratios.end());
  return {ratios.size(), quantile(ratios, 0.5), ratios.front(), ratios.back()};
}

CalibrationCurves BenchmarkSummary::curves(std::size_t factor) const {
  CalibrationCurves curves;
  for (std::size_t d = 0; d < record_.datasets.size(); ++d) curves = pooled(curves, cell(d, factor).curves);
  return curves;
}

std::vector<double> BenchmarkSummary::shared_values(const std::vector<std::size_t>& datasets, std::size_t factor,
                                                    const std::string& key) const {
  std::vector<double> values;
  for (const std::size_t d : datasets) {
    bool all = true;
    for (std::size_t f = 0; f < record_.factors.size(); ++f) all = all && cell(d, f).figure(key);
    if (all) values.push_back(*cell(d, factor).figure(key));
  }
  return values;
}

std::vector<std::pair<std::string, std::vector<std::size_t>>> groups_of(const BenchmarkRecord& record) {
  std::vector<std::pair<std::string, std::vector<std::size_t>>> groups;
  for (std::size_t d = 0; d < record.datasets.size(); ++d) {
    const std::string& name = record.datasets[d].group;
    auto found = std::find_if(groups.begin(), groups.end(), [&](const auto& group) { return group.first == name; });
    if (found == groups.end()) found = groups.insert(groups.end(), {name, {}});
    found->second.push_back(d);
  }
  return groups;
}

}  // namespace epiline
