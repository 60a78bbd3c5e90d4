#include "drivers/study/report/ensemble_tables.h"

#include <fmt/format.h>

namespace epiline {

namespace {

/// A figure's column and how many decimals it has.
struct SpreadColumn {
  const char* name;
  const char* key;
  int decimals;
};
constexpr SpreadColumn kSpreadColumns[] = {{"ATE, m", "ate_4dof_m", 4},      {"position", "nees_position", 2},
                                           {"yaw", "nees_yaw", 2},           {"tilt", "nees_tilt", 2},
                                           {"velocity", "nees_velocity", 2}, {"1 s, mm", "motion_1s_m", 1},
                                           {"5 s, mm", "motion_5s_m", 1},    {"20 s, mm", "motion_20s_m", 1}};

TableCell spread_cell(const BenchmarkCell& cell, const SpreadColumn& column) {
  const auto found = cell.spreads.find(column.key);
  if (found == cell.spreads.end()) return {"–", false, false, ""};
  const FigureSpread& s = found->second;
  const double scale = column.decimals == 1 ? 1000 : 1;
  return {fmt::format("{1:.{0}f} ({2:.{0}f}–{3:.{0}f})", column.decimals, scale * s.median, scale * s.least,
                      scale * s.largest),
          false, false, ""};
}

void add_curve(std::string dataset, std::string factor, const char* quantity, const CalibrationCurve& curve,
               FigureTable& t) {
  std::vector<TableCell> row{
      {std::move(dataset), false, false, ""}, {std::move(factor), false, false, ""}, {quantity, false, false, ""}};
  for (const double share : curve.share)
    row.push_back({curve.errors > 0 ? fmt::format("{:.0f}", 100 * share) : "–", false, false, ""});
  t.rows.push_back(std::move(row));
}

void add_curves(const std::string& dataset, const std::string& factor, const CalibrationCurves& curves,
                FigureTable& t) {
  add_curve(dataset, factor, "position", curves.position, t);
  add_curve("", "", "yaw", curves.yaw, t);
  add_curve("", "", "tilt", curves.tilt, t);
  add_curve("", "", "velocity", curves.velocity, t);
}

}  // namespace

FigureTable ensemble_table(const BenchmarkRecord& record, const BenchmarkSummary& summary) {
  FigureTable t;
  t.title = "Ensemble";
  t.note = fmt::format(
      "Median (least–largest) of {} runs that differ by nothing that matters: each starts one image later and sees "
      "gravity's seventh digit changed. NEES: per degree of freedom, 1 is consistent. Motion: rms error of the "
      "displacement over that time.",
      record.ensemble);
  t.groups = {{"", 1}, {"", 1}, {"", 1}, {"", 1}, {"NEES", 4}, {"motion over", 3}};
  t.columns = {"data set", "factor", "runs"};
  t.left = {true, true};
  for (const SpreadColumn& column : kSpreadColumns) t.columns.emplace_back(column.name);
  for (std::size_t d = 0; d < record.datasets.size(); ++d) {
    for (std::size_t f = 0; f < record.factors.size(); ++f) {
      const BenchmarkCell& cell = summary.cell(d, f);
      std::vector<TableCell> row{{f == 0 ? record.datasets[d].name : "", false, false, ""},
                                 {record.factors[f], false, false, ""},
                                 {fmt::format("{}/{}", cell.done, cell.runs), false, cell.done < cell.runs, ""}};
      for (const SpreadColumn& column : kSpreadColumns) row.push_back(spread_cell(cell, column));
      t.rows.push_back(std::move(row));
    }
  }
  return t;
}

FigureTable calibration_table(const BenchmarkRecord& record, const BenchmarkSummary& summary) {
  FigureTable t;
  t.title = "Calibration curve";
  t.note =
      "Share, %, of the poses of all runs whose error lies inside the region that the claimed covariance gives the "
      "probability above. Less than the probability: over-confident.";
  t.groups = {{"", 1}, {"", 1}, {"", 1}, {"claimed probability, %", kClaimedProbabilities.size()}};
  t.columns = {"data set", "factor", "error of"};
  t.left = {true, true, true};
  for (const double p : kClaimedProbabilities) t.columns.push_back(fmt::format("{:.0f}", 100 * p));
  for (std::size_t d = 0; d < record.datasets.size(); ++d) {
    for (std::size_t f = 0; f < record.factors.size(); ++f)
      add_curves(record.datasets[d].name, record.factors[f], summary.cell(d, f).curves, t);
  }
  if (record.datasets.size() == 1) return t;
  for (std::size_t f = 0; f < record.factors.size(); ++f) add_curves("all", record.factors[f], summary.curves(f), t);
  t.summary_rows = 4 * record.factors.size();
  return t;
}

}  // namespace epiline
