#include "drivers/study/report/benchmark_tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <numeric>

#include "drivers/study/report/ensemble_tables.h"
#include "drivers/study/report/published_figures.h"
#include "platform/math/statistics.h"

namespace epiline {

namespace {

constexpr const char* kNone = "–";

/// A column of figures: its heading, the key of the figure, how it is shown.
struct Column {
  const char* name;
  const char* key;
  const char* format;
  double scale = 1;
};

std::string shown(const std::optional<double>& value, const char* format, double scale = 1) {
  return value ? fmt::format(fmt::runtime(format), scale * *value) : kNone;
}

double or_nan(const std::optional<double>& value) { return value.value_or(std::numeric_limits<double>::quiet_NaN()); }

/// The figure, or why there is none.
TableCell error_cell(const BenchmarkCell& cell, const char* key) {
  const auto value = cell.figure(key);
  if (!value) return {cell.done == 0 ? to_string(cell.outcome) : kNone, false, cell.done == 0, ""};
  return {shown(value, "{:.4f}") + (cell.diverged ? " div" : ""), false, cell.diverged, ""};
}

/// One row of a block of columns, a column for each factor; the least value is marked.
template <class Cell, class Value>
void append_factors(std::size_t factors, Cell cell, Value value, std::vector<TableCell>& row) {
  std::vector<double> values;
  const std::size_t first = row.size();
  for (std::size_t f = 0; f < factors; ++f) {
    row.push_back(cell(f));
    values.push_back(value(f));
  }
  std::vector<TableCell*> cells;
  for (std::size_t i = first; i < row.size(); ++i) cells.push_back(&row[i]);
  mark_least(values, cells);
}

/// Over the data sets that can be compared: mean or median of each factor.
std::vector<TableCell> summary_row(const char* name, const BenchmarkRecord& record, const BenchmarkSummary& summary,
                                   const std::vector<std::size_t>& datasets, double Summary::*statistic) {
  std::vector<TableCell> row{{name, false, false, ""}};
  for (const auto& [key, format] : {std::pair{"ate_4dof_m", "{:.4f}"}, std::pair{"solve_ms_mean", "{:.3f}"}}) {
    const auto value = [&, k = key](std::size_t f) {
      const Summary s = summarise(summary.shared_values(datasets, f, k));
      return s.count > 0 ? s.*statistic : std::numeric_limits<double>::quiet_NaN();
    };
    const auto cell = [&, text = format](std::size_t f) -> TableCell {
      const double v = value(f);
      return {v == v ? fmt::format(fmt::runtime(text), v) : kNone, false, false, ""};
    };
    append_factors(record.factors.size(), cell, value, row);
  }
  return row;
}

struct PublishedColumn {
  const char* name;
  double PublishedFigures::*figure;
  const char* format;
};
constexpr PublishedColumn kPublishedColumns[] = {
    {"paper", &PublishedFigures::paper_m, "{:.3f}"},   {"VINS-Mono", &PublishedFigures::vins_m, "{:.3f}"},
    {"basalt", &PublishedFigures::basalt_m, "{:.2f}"}, {"VI-DSO", &PublishedFigures::vi_dso_m, "{:.2f}"},
    {"paper", &PublishedFigures::paper_ms, "{:.2f}"},  {"VINS-Mono", &PublishedFigures::vins_ms, "{:.2f}"}};

/// Columns for what others published for these flights, if anything.
void add_published(const BenchmarkRecord& record, const std::vector<std::size_t>& datasets, FigureTable& t) {
  std::vector<const PublishedFigures*> published;
  for (const std::size_t d : datasets) published.push_back(published_figures(record.datasets[d].name));
  if (std::all_of(published.begin(), published.end(), [](const auto* p) { return p == nullptr; })) return;
  t.note += " Published: whole flights, on other computers; basalt: with two cameras.";
  t.groups.insert(t.groups.end(), {{"published ATE, m", 4}, {"published solve, ms", 2}});
  for (const PublishedColumn& column : kPublishedColumns) {
    t.columns.emplace_back(column.name);
    std::vector<double> values;
    for (std::size_t i = 0; i < published.size(); ++i) {
      const double value = published[i] ? published[i]->*column.figure : 0;
      if (value > 0) values.push_back(value);
      t.rows[i].push_back({value > 0 ? shown(value, column.format) : kNone, false, false, ""});
    }
    if (t.summary_rows == 0) continue;
    const Summary s = summarise(std::move(values));
    const bool all = s.count == datasets.size();  // else it cannot be compared with the others
    t.rows[published.size()].push_back({all ? shown(s.mean, column.format) : kNone, false, false, ""});
    t.rows[published.size() + 1].push_back({all ? shown(s.median, column.format) : kNone, false, false, ""});
  }
}

FigureTable error_and_solve_table(const BenchmarkRecord& record, const BenchmarkSummary& summary,
                                  const std::string& group, const std::vector<std::size_t>& datasets) {
  const std::size_t factors = record.factors.size();
  FigureTable t;
  t.title = "Error and solve time: " + group;
  t.note =
      "ATE: rms position error, causal, after alignment by origin and heading. Solve: the optimisation alone, mean "
      "over the solved images. Mean and median: over the data sets where every factor has the figure.";
  t.groups = {{"", 1}, {"ATE, m", factors}, {"mean solve time, ms", factors}};
  t.columns = {"data set"};
  for (int block = 0; block < 2; ++block)
    t.columns.insert(t.columns.end(), record.factors.begin(), record.factors.end());
  t.left = {true};
  for (const std::size_t d : datasets) {
    std::vector<TableCell> row{{record.datasets[d].name, false, false, ""}};
    const auto figure = [&](const char* key) {
      return [&summary, d, key](std::size_t f) { return or_nan(summary.cell(d, f).figure(key)); };
    };
    append_factors(
        factors, [&](std::size_t f) { return error_cell(summary.cell(d, f), "ate_4dof_m"); }, figure("ate_4dof_m"),
        row);
    append_factors(
        factors,
        [&](std::size_t f) -> TableCell {
          return {shown(summary.cell(d, f).figure("solve_ms_mean"), "{:.3f}"), false, false, ""};
        },
        figure("solve_ms_mean"), row);
    t.rows.push_back(std::move(row));
  }
  if (datasets.size() > 1) {
    t.rows.push_back(summary_row("mean", record, summary, datasets, &Summary::mean));
    t.rows.push_back(summary_row("median", record, summary, datasets, &Summary::median));
    t.summary_rows = 2;
  }
  add_published(record, datasets, t);
  return t;
}

std::vector<std::size_t> all_datasets(const BenchmarkRecord& record) {
  std::vector<std::size_t> all(record.datasets.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  return all;
}

FigureTable work_table(const BenchmarkRecord& record, const BenchmarkSummary& summary) {
  const std::vector<Column> columns = {
      {"wall", "track_ms_mean", "{:.3f}"},         {"CPU", "track_cpu_ms_mean", "{:.3f}"},
      {"wall", "solve_ms_mean", "{:.3f}"},         {"CPU", "solve_cpu_ms_mean", "{:.3f}"},
      {"wall", "marginalise_ms_mean", "{:.3f}"},   {"CPU", "marginalise_cpu_ms_mean", "{:.3f}"},
      {"wall", "estimate_ms_mean", "{:.3f}"},      {"CPU", "estimate_cpu_ms_mean", "{:.3f}"},
      {"state size", "state_size_mean", "{:.0f}"}, {"iterations", "iterations_mean", "{:.2f}"},
      {"residuals", "residuals_mean", "{:.0f}"},   {"memory, MiB", "peak_rss_mib", "{:.0f}"}};
  FigureTable t;
  t.title = "Time and work per image";
  t.note =
      "Mean over the images of a run, then median over the data sets where every factor has the figure. CPU: processor "
      "time of the stage's thread, which depends least on other programs.";
  t.groups = {{"", 1}, {"track, ms", 2}, {"solve, ms", 2}, {"marginalise, ms", 2}, {"estimate, ms", 2}, {"", 4}};
  t.columns = {"factor"};
  t.left = {true};
  for (const Column& c : columns) t.columns.emplace_back(c.name);
  for (std::size_t f = 0; f < record.factors.size(); ++f) {
    std::vector<TableCell> row{{record.factors[f], false, false, ""}};
    for (const Column& c : columns) {
      const Summary s = summarise(summary.shared_values(all_datasets(record), f, c.key));
      row.push_back({s.count > 0 ? shown(s.median, c.format, c.scale) : kNone, false, false, ""});
    }
    t.rows.push_back(std::move(row));
  }
  return t;
}

FigureTable ratio_table(const BenchmarkRecord& record, const BenchmarkSummary& summary) {
  const std::vector<Column> columns = {{"ATE 4-DoF", "ate_4dof_m", ""},
                                       {"ATE SE(3)", "ate_se3_m", ""},
                                       {"solve mean", "solve_ms_mean", ""},
                                       {"solve median", "solve_ms_p50", ""},
                                       {"solve CPU mean", "solve_cpu_ms_mean", ""},
                                       {"estimate mean", "estimate_ms_mean", ""},
                                       {"estimate median", "estimate_ms_p50", ""},
                                       {"estimate CPU mean", "estimate_cpu_ms_mean", ""},
                                       {"residuals", "residuals_mean", ""}};
  FigureTable t;
  t.title = "Ratios to " + record.factors[summary.baseline()];
  t.note =
      "Median of the ratios of the data sets (smallest–largest). Data sets where one of the two has no figure are left "
      "out.";
  t.columns = {"factor"};
  t.left = {true};
  for (const Column& c : columns) t.columns.emplace_back(c.name);
  t.columns.emplace_back("sets");
  for (std::size_t f = 0; f < record.factors.size(); ++f) {
    if (f == summary.baseline()) continue;
    std::vector<TableCell> row{{record.factors[f], false, false, ""}};
    for (const Column& c : columns) {
      const BenchmarkRatio r = summary.ratio(f, c.key);
      row.push_back({r.datasets > 0 ? fmt::format("{:.2f} ({:.2f}–{:.2f})", r.median, r.least, r.largest) : kNone,
                     false, false, ""});
    }
    row.push_back({fmt::format("{} of {}", summary.ratio(f, "solve_ms_mean").datasets, record.datasets.size()), false,
                   false, ""});
    t.rows.push_back(std::move(row));
  }
  return t;
}

/// One row for each data set and factor; those without any figure are left out unless `all`.
FigureTable detail_table(const BenchmarkRecord& record, const BenchmarkSummary& summary, std::string title,
                         std::string note, const std::vector<Column>& columns, bool all = false) {
  FigureTable t;
  t.title = std::move(title);
  t.note = std::move(note);
  t.columns = {"data set", "factor"};
  t.left = {true, true};
  for (const Column& c : columns) t.columns.emplace_back(c.name);
  for (std::size_t d = 0; d < record.datasets.size(); ++d) {
    std::string name = record.datasets[d].name;  // in its first row only
    for (std::size_t f = 0; f < record.factors.size(); ++f) {
      const BenchmarkCell& cell = summary.cell(d, f);
      if (cell.done == 0 && !all) continue;
      std::vector<TableCell> row{{name, false, false, ""}, {record.factors[f], false, false, ""}};
      for (const Column& c : columns) row.push_back({shown(cell.figure(c.key), c.format, c.scale), false, false, ""});
      t.rows.push_back(std::move(row));
      name.clear();
    }
  }
  return t;
}

FigureTable error_table(const BenchmarkRecord& record, const BenchmarkSummary& summary) {
  FigureTable t = detail_table(
      record, summary, "Errors",
      "Medians over the repetitions. ATE: rms position error after alignment of that kind. Drift: mean error of the "
      "motion over segments of that length. NEES: per degree of freedom; 1 is consistent, above is over-confident.",
      {{"4-DoF", "ate_4dof_m", "{:.4f}"},
       {"its max", "ate_4dof_max_m", "{:.4f}"},
       {"SE(3)", "ate_se3_m", "{:.4f}"},
       {"Sim(3)", "ate_sim3_m", "{:.4f}"},
       {"%", "rpe_1m_percent", "{:.2f}"},
       {"deg", "rpe_1m_deg", "{:.2f}"},
       {"%", "rpe_10m_percent", "{:.2f}"},
       {"deg", "rpe_10m_deg", "{:.2f}"},
       {"scale, %", "scale_error_abs", "{:.2f}", 100},
       {"yaw drift, deg", "yaw_drift_abs_deg", "{:.2f}"},
       {"position", "nees_position", "{:.2f}"},
       {"yaw", "nees_yaw", "{:.2f}"},
       {"tilt", "nees_tilt", "{:.2f}"},
       {"velocity", "nees_velocity", "{:.2f}"}});
  t.groups = {{"", 1}, {"", 1}, {"ATE, m", 4}, {"drift over 1 m", 2}, {"over 10 m", 2}, {"", 1}, {"", 1}, {"NEES", 4}};
  return t;
}

FigureTable survival_table(const BenchmarkRecord& record, const BenchmarkSummary& summary) {
  FigureTable t =
      detail_table(record, summary, "Start and survival",
                   "Medians over the repetitions. Coverage: share of images with a pose, since the first pose.",
                   {{"start, s", "start_s", "{:.2f}"},
                    {"coverage, %", "coverage", "{:.1f}", 100},
                    {"resets", "resets", "{:.0f}"},
                    {"degraded, s", "degraded_s", "{:.1f}"},
                    {"lost, s", "lost_s", "{:.1f}"}},
                   true);
  t.columns.insert(t.columns.end(), {"runs done", "repeats agree", "outcome"});
  t.left.resize(t.columns.size(), false);
  t.left.back() = true;
  for (std::size_t i = 0; i < t.rows.size(); ++i) {
    const BenchmarkCell& cell = summary.cell(i / record.factors.size(), i % record.factors.size());
    std::string outcome = cell.diverged ? "diverged" : to_string(cell.outcome);
    if (!cell.message.empty()) outcome += ": " + cell.message;
    const bool good = cell.done == cell.runs && !cell.diverged;
    t.rows[i].push_back({fmt::format("{}/{}", cell.done, cell.runs), false, cell.done < cell.runs, ""});
    t.rows[i].push_back({cell.done < 2 || record.ensemble > 0 ? kNone
                         : cell.identical                     ? "yes"
                                                              : "NO",
                         false, !cell.identical && record.ensemble == 0, ""});
    t.rows[i].push_back({outcome, false, !good, cell.done > 0 ? cell.folder + "/report.html" : ""});
  }
  return t;
}

/// `clock`: what the keys of the figures have between the stage's name and the statistic's.
FigureTable time_table(const BenchmarkRecord& record, const BenchmarkSummary& summary, std::string title,
                       std::string note, const std::string& clock) {
  std::vector<std::string> keys;
  for (const char* stage : {"track", "solve", "estimate"})
    for (const char* statistic : {"mean", "p50", "p99", "max"})
      keys.push_back(fmt::format("{}_{}_{}", stage, clock, statistic));
  std::vector<Column> columns;
  for (std::size_t i = 0; i < keys.size(); i += 4) {
    columns.push_back({"mean", keys[i].c_str(), "{:.3f}"});
    columns.push_back({"50 %", keys[i + 1].c_str(), "{:.3f}"});
    columns.push_back({"99 %", keys[i + 2].c_str(), "{:.3f}"});
    columns.push_back({"max", keys[i + 3].c_str(), "{:.2f}"});
  }
  FigureTable t = detail_table(record, summary, std::move(title), std::move(note), columns);
  t.groups = {{"", 1}, {"", 1}, {"track", 4}, {"solve", 4}, {"estimate", 4}};
  return t;
}

}  // namespace

std::vector<FigureTable> benchmark_tables(const BenchmarkRecord& record, const BenchmarkSummary& summary) {
  std::vector<FigureTable> tables;
  for (const auto& [group, datasets] : groups_of(record))
    tables.push_back(error_and_solve_table(record, summary, group, datasets));
  tables.push_back(work_table(record, summary));
  if (record.factors.size() > 1) tables.push_back(ratio_table(record, summary));
  tables.push_back(error_table(record, summary));
  if (record.ensemble > 0) {
    tables.push_back(ensemble_table(record, summary));
    tables.push_back(calibration_table(record, summary));
  }
  tables.push_back(survival_table(record, summary));
  tables.push_back(time_table(record, summary, "Processor time per image, ms",
                              "Medians over the repetitions. Processor time of the stage's thread.", "cpu_ms"));
  tables.push_back(time_table(record, summary, "Wall time per image, ms",
                              fmt::format("Medians over the repetitions. {} runs at the same time, and other programs "
                                          "on this computer, lengthen these times.",
                                          record.jobs),
                              "ms"));
  tables.push_back(detail_table(record, summary, "Work and memory", "Means over the solved images.",
                                {{"state size", "state_size_mean", "{:.0f}"},
                                 {"iterations", "iterations_mean", "{:.2f}"},
                                 {"residuals", "residuals_mean", "{:.0f}"},
                                 {"tracks per image", "tracks_mean", "{:.0f}"},
                                 {"peak memory, MiB", "peak_rss_mib", "{:.0f}"}}));
  return tables;
}

}  // namespace epiline
