#include "drivers/study/montecarlo/study_report.h"

#include <fmt/format.h>

#include "drivers/study/report/figure_table.h"
#include "drivers/study/report/page.h"
#include "drivers/study/report/stats_json.h"

namespace epiline {

namespace {

constexpr const char* kNone = "–";

TableCell cell_of(std::string text) { return {std::move(text), false, false, ""}; }

/// Dashes where every run diverged.
TableCell error_cell(const Summary& s, double value, const char* format) {
  return cell_of(s.count > 0 ? fmt::format(fmt::runtime(format), value) : kNone);
}

/// A table whose rows are the cells; `fill` adds what comes after flight and factor.
template <class Fill>
FigureTable table_of(const std::vector<StudyCell>& cells, std::string title, std::string note,
                     std::vector<std::string> columns, Fill fill) {
  FigureTable t;
  t.title = std::move(title);
  t.note = std::move(note);
  t.columns = {"flight", "factor"};
  t.columns.insert(t.columns.end(), columns.begin(), columns.end());
  t.left = {true, true};
  std::string last;
  for (const StudyCell& cell : cells) {
    const std::string flight = to_string(cell.flight);
    std::vector<TableCell> row{cell_of(flight == last ? "" : flight), cell_of(cell.variant)};
    fill(summary_of(cell), row);
    t.rows.push_back(std::move(row));
    last = flight;
  }
  return t;
}

FigureTable error_table(const std::vector<StudyCell>& cells) {
  return table_of(
      cells, "Errors",
      "Of the runs that did not diverge. ATE: rms over the runs of each run's rms after alignment by origin "
      "and heading.",
      {"diverged", "ATE, m", "median", "drift in 5 s, m", "|scale|, %", "scale, %", "yaw at the end, deg",
       "time offset, ms"},
      [](const StudySummary& s, std::vector<TableCell>& row) {
        row.push_back({fmt::format("{}/{}", s.diverged, s.runs), false, s.diverged > 0, ""});
        row.push_back(error_cell(s.ate, s.ate.rmse, "{:.4f}"));
        row.push_back(error_cell(s.ate, s.ate.median, "{:.4f}"));
        row.push_back(error_cell(s.ate, s.rpe.rmse, "{:.4f}"));
        row.push_back(error_cell(s.ate, 100 * s.scale_abs.mean, "{:.2f}"));
        row.push_back(error_cell(s.ate, 100 * s.scale_mean, "{:+.2f}"));
        row.push_back(error_cell(s.ate, s.yaw.mean, "{:.2f}"));
        row.push_back(error_cell(s.ate, 1e3 * s.time_offset.rmse, "{:.3f}"));
      });
}

FigureTable consistency_table(const std::vector<StudyCell>& cells) {
  FigureTable t = table_of(
      cells, "Consistency",
      "NEES per degree of freedom, means over each run: 1 is consistent, 4 means errors twice as large "
      "as claimed.",
      {"mean", "median", "95 %", "mean", "median", "95 %"}, [](const StudySummary& s, std::vector<TableCell>& row) {
        for (const Summary* nees : {&s.nees_position, &s.nees_rotation}) {
          for (const double v : {nees->mean, nees->median, nees->p95}) row.push_back(error_cell(s.ate, v, "{:.2f}"));
        }
      });
  t.groups = {{"", 1}, {"", 1}, {"NEES position", 3}, {"NEES rotation", 3}};
  return t;
}

FigureTable time_table(const std::vector<StudyCell>& cells, int jobs) {
  FigureTable t = table_of(cells, "Time per frame, ms", fmt::format("{} threads at work.", jobs),
                           {"mean", "50 %", "99 %", "mean", "50 %", "99 %"},
                           [](const StudySummary& s, std::vector<TableCell>& row) {
                             for (const Summary* time : {&s.solve_ms, &s.estimate_ms}) {
                               for (const double v : {time->mean, time->median, time->p99})
                                 row.push_back(error_cell(*time, v, "{:.3f}"));
                             }
                           });
  t.groups = {{"", 1}, {"", 1}, {"solve", 3}, {"estimate", 3}};
  return t;
}

Json times_json(const Summary& s) {
  if (s.count == 0) return nullptr;
  return {{"mean", s.mean}, {"p50", s.median}, {"p99", s.p99}, {"max", s.max}};
}

Json run_json(const RunFigures& r, std::uint64_t seed) {
  return {{"seed", seed},
          {"diverged", r.diverged},
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
Json errors_json(const StudySummary& s) {
  if (s.ate.count == 0) return nullptr;
  const auto nees = [](const Summary& n) { return Json{{"mean", n.mean}, {"median", n.median}, {"p95", n.p95}}; };
  return {{"ate_m", {{"rms", s.ate.rmse}, {"median", s.ate.median}}},
          {"rpe_5s_m", s.rpe.rmse},
          {"scale_error", {{"mean_abs", s.scale_abs.mean}, {"mean", s.scale_mean}}},
          {"yaw_end_deg", s.yaw.mean},
          {"nees_position", nees(s.nees_position)},
          {"nees_rotation", nees(s.nees_rotation)},
          {"time_offset_error_rms_s", s.time_offset.rmse}};
}

Json cell_json(const StudyCell& cell, std::uint64_t first_seed) {
  const StudySummary s = summary_of(cell);
  Json runs = Json::array();
  for (std::size_t i = 0; i < cell.runs.size(); ++i) runs.push_back(run_json(cell.runs[i], first_seed + i));
  return {{"flight", to_string(cell.flight)},
          {"factor", cell.variant},
          {"diverged", s.diverged},
          {"errors", errors_json(s)},
          {"timing_ms",
           {{"solve", times_json(s.solve_ms)},
            {"marginalise", times_json(s.marginalise_ms)},
            {"estimate", times_json(s.estimate_ms)}}},
          {"runs", runs}};
}

}  // namespace

std::string study_text(const std::vector<StudyCell>& cells, const StudyOptions& o) {
  std::string text = fmt::format(
      "{} runs of each flight, seeds from {}; {}\n"
      "noise of the tracks: {} px white, {} px correlated over {} images, {} px random walk per root of an image, {} % "
      "outliers; time offset {} ms; readout {} ms\n",
      o.runs, o.seed, program_text(program_info()), o.noise.pixel_sigma, o.correlated.sigma_px, o.correlated.images,
      o.noise.drift_px, 100 * o.noise.outlier_share, 1e3 * o.time_offset_s, 1e3 * o.readout_s);
  for (const FigureTable& table : {error_table(cells), consistency_table(cells), time_table(cells, o.jobs)})
    text.append("\n").append(to_text(table));
  return text;
}

Json study_json(const std::vector<StudyCell>& cells, const StudyOptions& o) {
  Json results = Json::array();
  for (const StudyCell& cell : cells) results.push_back(cell_json(cell, o.seed));
  return {{"schema", 1},
          {"program", to_json(program_info())},
          {"settings",
           {{"runs", o.runs},
            {"seed", o.seed},
            {"jobs", o.jobs},
            {"pixel_noise_px", o.noise.pixel_sigma},
            {"correlated_noise_px", o.correlated.sigma_px},
            {"correlation_images", o.correlated.images},
            {"drift_px", o.noise.drift_px},
            {"outlier_share", o.noise.outlier_share},
            {"assumed_sigma_px", o.assumed_sigma_px ? Json(*o.assumed_sigma_px) : Json(nullptr)},
            {"time_offset_s", o.time_offset_s},
            {"readout_s", o.readout_s}}},
          {"results", results}};
}

}  // namespace epiline
