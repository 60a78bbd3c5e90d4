#include "drivers/study/report/benchmark_report.h"

#include <fmt/format.h>

#include "drivers/study/evaluate/errors.h"
#include "drivers/study/report/benchmark_tables.h"
#include "drivers/study/report/calibration_plot.h"
#include "drivers/study/report/page.h"
#include "drivers/study/report/stats_json.h"
#include "drivers/study/report/svg_plot.h"

namespace epiline {

namespace {

Json runs_json(const BenchmarkRecord& record) {
  Json runs = Json::array();
  for (const BenchmarkRun& run : record.runs) {
    runs.push_back({{"dataset", record.datasets[run.dataset].name},
                    {"factor", record.factors[run.factor]},
                    {"repetition", run.repetition},
                    {"outcome", to_string(run.outcome)},
                    {"message", run.message.empty() ? Json(nullptr) : Json(run.message)},
                    {"folder", run.folder},
                    {"stats", run.stats}});
  }
  return runs;
}

/// A null for every figure that is missing: the fields are always there.
Json medians_json(const BenchmarkCell& cell) {
  Json medians = Json::object();
  for (const BenchmarkFigure& figure : benchmark_figures()) {
    const auto value = cell.figure(figure.key);
    medians[figure.key] = value ? Json(*value) : Json(nullptr);
  }
  return medians;
}

/// Quartiles and extremes over an ensemble.
Json spreads_json(const BenchmarkCell& cell) {
  Json spreads = Json::object();
  for (const BenchmarkFigure& figure : benchmark_figures()) {
    const auto found = cell.spreads.find(figure.key);
    if (found == cell.spreads.end()) {
      spreads[figure.key] = nullptr;
      continue;
    }
    const FigureSpread& s = found->second;
    spreads[figure.key] = {{"q25", s.lower_quartile}, {"q75", s.upper_quartile}, {"min", s.least}, {"max", s.largest}};
  }
  return spreads;
}

Json results_json(const BenchmarkRecord& record, const BenchmarkSummary& summary) {
  Json results = Json::array();
  for (std::size_t d = 0; d < record.datasets.size(); ++d) {
    for (std::size_t f = 0; f < record.factors.size(); ++f) {
      const BenchmarkCell& cell = summary.cell(d, f);
      results.push_back(
          {{"dataset", record.datasets[d].name},
           {"factor", record.factors[f]},
           {"runs", cell.runs},
           {"done", cell.done},
           {"outcome", to_string(cell.outcome)},
           {"diverged", cell.diverged},
           {"repetitions_identical", cell.done > 1 && record.ensemble == 0 ? Json(cell.identical) : Json()},
           {"median", medians_json(cell)},
           {"spread", record.ensemble > 0 ? spreads_json(cell) : Json()},
           {"calibration_curve", to_json(cell.curves)}});
    }
  }
  return results;
}

Json ratios_json(const BenchmarkRecord& record, const BenchmarkSummary& summary) {
  Json ratios = Json::array();
  for (std::size_t f = 0; f < record.factors.size(); ++f) {
    if (f == summary.baseline()) continue;
    Json figures = Json::object();
    for (const BenchmarkFigure& figure : benchmark_figures()) {
      const BenchmarkRatio r = summary.ratio(f, figure.key);
      figures[figure.key] =
          r.datasets == 0 ? Json(nullptr)
                          : Json{{"median", r.median}, {"min", r.least}, {"max", r.largest}, {"datasets", r.datasets}};
    }
    ratios.push_back({{"factor", record.factors[f]}, {"to", record.factors[summary.baseline()]}, {"ratio", figures}});
  }
  return ratios;
}

std::string subtitle(const BenchmarkRecord& record) {
  const std::string runs = record.ensemble > 0 ? fmt::format("ensemble of {}", record.ensemble)
                                               : fmt::format("repetitions: {}", record.repeat);
  return fmt::format("{} data sets, {} factors; {}, side by side: {}; {}; {}", record.datasets.size(),
                     record.factors.size(), runs, record.jobs, record.processor, program_text(record.program));
}

/// c1 to c4, then again.
std::string style_of(std::size_t factor) { return fmt::format("c{}", factor % 4 + 1); }

/// All factors' paths on one data set from above, and the distributions of their errors.
struct DatasetPlots {
  Plot paths;
  BoxPlot errors;
};

PlotLine path_line(const Trajectory& estimate, const Similarity& T, const std::string& label,
                   const std::string& style) {
  PlotLine line{label, style, {}, {}};
  for (const TimedPose& pose : estimate.poses) {
    const Vec3 p = T(pose.p_WB);
    line.x.push_back(p.x());
    line.y.push_back(p.y());
  }
  return line;
}

DatasetPlots plots_of(const BenchmarkRecord& record, const BenchmarkSummary& summary, std::size_t dataset) {
  DatasetPlots plots;
  plots.paths.x_label = "x, m";
  plots.paths.y_label = "y, m";
  plots.paths.equal_axes = true;
  plots.errors.y_label = "position error, m";
  const auto& truth = record.datasets[dataset].truth;
  PlotLine truth_line{"ground truth", "truth", {}, {}};
  for (std::size_t f = 0; f < record.factors.size(); ++f) {
    PlotBox box{record.factors[f], style_of(f), {}};
    if (const Trajectory* estimate = summary.cell(dataset, f).estimate) {
      const Overlay o = truth ? overlay(*estimate, *truth) : Overlay{};
      plots.paths.lines.push_back(path_line(*estimate, o.T, record.factors[f], style_of(f)));
      for (const PosePair& pair : o.pairs) box.values.push_back((pair.reference.p_WB - o.T(pair.estimate.p_WB)).norm());
      if (o.pairs.size() > truth_line.x.size()) {  // as far as the longest estimate goes
        truth_line = {"ground truth", "truth", {}, {}};
        for (const PosePair& pair : o.pairs) {
          truth_line.x.push_back(pair.reference.p_WB.x());
          truth_line.y.push_back(pair.reference.p_WB.y());
        }
      }
    }
    plots.errors.boxes.push_back(std::move(box));
  }
  if (!truth_line.x.empty()) plots.paths.lines.insert(plots.paths.lines.begin(), std::move(truth_line));
  return plots;
}

std::string dataset_card(const BenchmarkRecord& record, const BenchmarkSummary& summary, std::size_t dataset) {
  const BenchmarkDataset& d = record.datasets[dataset];
  constexpr PlotSize kSize{560, 380};
  std::string note = escaped(d.path);
  for (std::size_t f = 0; f < record.factors.size(); ++f) {
    const BenchmarkCell& cell = summary.cell(dataset, f);
    if (cell.done == 0)
      note += fmt::format("<br>{}: {}, {}", record.factors[f], to_string(cell.outcome), escaped(cell.message));
  }
  const DatasetPlots plots = plots_of(record, summary, dataset);
  if (plots.paths.lines.empty()) return html_card(escaped(d.name), note, "", true);
  std::string content =
      fmt::format(R"(<div class="two"><div><h3>Path from above</h3>{}</div>)", svg(plots.paths, kSize));
  if (d.truth) {
    content +=
        fmt::format(R"(<div><h3>Position error: quartiles, 5 to 95 %, largest</h3>{}</div>)", svg(plots.errors, kSize));
  }
  return html_card(escaped(d.name), note, content + "</div>", true);
}

/// One plot for each factor, of the poses of all data sets.
std::string calibration_card(const BenchmarkRecord& record, const BenchmarkSummary& summary) {
  std::string plots;
  for (std::size_t f = 0; f < record.factors.size(); ++f) {
    const std::string plot = calibration_svg(summary.curves(f));
    if (!plot.empty()) plots += fmt::format("<div><h3>{}</h3>{}</div>", record.factors[f], plot);
  }
  if (plots.empty()) return "";
  if (record.factors.size() == 1) plots += "<div></div>";  // one plot must not grow to the page's width
  return html_card("Claimed and actual error, all data sets", kCalibrationNote,
                   fmt::format(R"(<div class="two">{}</div>)", plots), true);
}

std::string ratio_tiles(const BenchmarkRecord& record, const BenchmarkSummary& summary) {
  std::string s;
  const std::string& baseline = record.factors[summary.baseline()];
  for (std::size_t f = 0; f < record.factors.size(); ++f) {
    if (f == summary.baseline()) continue;
    const BenchmarkRatio error = summary.ratio(f, "ate_4dof_m"), time = summary.ratio(f, "solve_ms_mean");
    const std::string& name = record.factors[f];
    if (error.datasets > 0)
      s +=
          html_tile(fmt::format("{:.2f} ×", error.median),
                    fmt::format("error of {} over that of {}, median of {} data sets", name, baseline, error.datasets));
    if (time.datasets > 0)
      s += html_tile(
          fmt::format("{:.2f} ×", time.median),
          fmt::format("solve time of {} over that of {}, median of {} data sets", name, baseline, time.datasets));
  }
  return s.empty() ? s : fmt::format(R"(<div class="tiles">{}</div>)", s);
}

}  // namespace

Json benchmark_json(const BenchmarkRecord& record, const BenchmarkSummary& summary) {
  Json datasets = Json::array();
  for (const BenchmarkDataset& d : record.datasets)
    datasets.push_back(
        {{"name", d.name}, {"group", d.group}, {"path", d.path}, {"has_ground_truth", d.truth.has_value()}});
  return {{"schema", 1},
          {"program", to_json(record.program)},
          {"processor", record.processor},
          {"settings",
           {{"factors", record.factors},
            {"repeat", record.repeat},
            {"ensemble", record.ensemble > 0 ? Json(record.ensemble) : Json()},
            {"jobs", record.jobs},
            {"camera", record.camera},
            {"config", record.config.empty() ? Json(nullptr) : Json(record.config)}}},
          {"datasets", datasets},
          {"results", results_json(record, summary)},
          {"ratios", ratios_json(record, summary)},
          {"runs", runs_json(record)}};
}

std::string benchmark_text(const BenchmarkRecord& record, const BenchmarkSummary& summary) {
  std::string text = subtitle(record) + "\n";
  for (const FigureTable& table : benchmark_tables(record, summary)) text.append("\n").append(to_text(table));
  return text;
}

std::string benchmark_html(const BenchmarkRecord& record, const BenchmarkSummary& summary) {
  std::string body = fmt::format(R"({}<div class="grid2">)", ratio_tiles(record, summary));
  for (const FigureTable& table : benchmark_tables(record, summary))
    body += html_card(escaped(table.title), escaped(table.note), to_html(table), true);
  body += calibration_card(record, summary);
  for (std::size_t d = 0; d < record.datasets.size(); ++d) body += dataset_card(record, summary, d);
  return html_page("Benchmark of visual factors", subtitle(record), body + "</div>");
}

}  // namespace epiline
