#include "drivers/study/report/benchmark_record.h"

#include <gtest/gtest.h>

#include "drivers/study/report/benchmark_report.h"
#include "drivers/study/report/benchmark_tables.h"
#include "drivers/study/report/ensemble_tables.h"

namespace epiline {
namespace {

BenchmarkRun run_with(double ate_m, std::size_t errors, double share, int repetition) {
  CalibrationCurves curves;
  curves.position.errors = errors;
  curves.position.share.fill(share);
  BenchmarkRun run;
  run.repetition = repetition;
  run.outcome = RunOutcome::kDone;
  run.stats["error"]["ate_4dof_m"]["rmse"] = ate_m;
  run.stats["error"]["motion"] = {{{"seconds", 1.0}, {"translation_m", {{"rmse", 2 * ate_m}}}},
                                  {{"seconds", 5.0}, {"translation_m", {{"rmse", 3 * ate_m}}}}};
  run.stats["error"]["calibration_curve"] = to_json(curves);
  return run;
}

/// Four runs that are done, in no order, and one that failed.
BenchmarkRecord ensemble() {
  BenchmarkRecord record;
  record.ensemble = 5;
  record.factors = {"track"};
  record.datasets = {{"hall", "flights", "flights/hall", {}}};
  record.runs = {run_with(0.04, 100, 0.2, 1), run_with(0.01, 300, 0.6, 2), run_with(0.03, 100, 0.2, 3),
                 run_with(0.02, 100, 0.2, 4), BenchmarkRun{}};
  return record;
}

TEST(Ensemble, SpreadsAreThoseOfTheRunsThatAreDone) {
  const BenchmarkRecord record = ensemble();
  const BenchmarkSummary summary(record);
  const FigureSpread s = summary.cell(0, 0).spreads.at("ate_4dof_m");
  EXPECT_NEAR(s.median, 0.025, 1e-15);
  EXPECT_NEAR(s.lower_quartile, 0.0175, 1e-15);
  EXPECT_NEAR(s.upper_quartile, 0.0325, 1e-15);
  EXPECT_EQ(s.least, 0.01);
  EXPECT_EQ(s.largest, 0.04);
  EXPECT_NEAR(*summary.cell(0, 0).figure("motion_5s_m"), 0.075, 1e-15);
  EXPECT_FALSE(summary.cell(0, 0).figure("motion_20s_m"));
  const Json b = benchmark_json(record, summary);
  const Json& result = b["results"][0];
  EXPECT_EQ(b["settings"]["ensemble"], 5);
  EXPECT_EQ(result["done"], 4);
  EXPECT_TRUE(result["repetitions_identical"].is_null());  // they are not meant to be
  EXPECT_NEAR(result["median"]["ate_4dof_m"], 0.025, 1e-15);
  EXPECT_NEAR(result["spread"]["ate_4dof_m"]["q25"], 0.0175, 1e-15);
  EXPECT_EQ(result["spread"]["ate_4dof_m"]["max"], 0.04);
  EXPECT_TRUE(result["spread"]["nees_yaw"].is_null());
  const std::string text = to_text(ensemble_table(record, summary));
  for (const char* part : {"4/5", "0.0250 (0.0100–0.0400)", "50.0 (20.0–80.0)"})
    EXPECT_NE(text.find(part), std::string::npos) << part << " not in " << text;
}

TEST(Ensemble, CurvesArePooledByTheirPoses) {
  const BenchmarkRecord record = ensemble();
  const BenchmarkSummary summary(record);
  const CalibrationCurve curve = summary.cell(0, 0).curves.position;
  EXPECT_EQ(curve.errors, 600u);
  for (const double share : curve.share) EXPECT_NEAR(share, (3 * 100 * 0.2 + 300 * 0.6) / 600, 1e-12);
  EXPECT_EQ(summary.cell(0, 0).curves.yaw.errors, 0u);
  const Json json = benchmark_json(record, summary)["results"][0]["calibration_curve"];
  EXPECT_EQ(json["position"]["errors"], 600);
  EXPECT_TRUE(json["yaw"].is_null());
  EXPECT_EQ(json["probability"][4], 0.5);
}

TEST(Repetitions, HaveNoSpread) {
  BenchmarkRecord record = ensemble();
  record.ensemble = 0;
  const BenchmarkSummary summary(record);
  const Json b = benchmark_json(record, summary);
  EXPECT_TRUE(b["results"][0]["spread"].is_null());
  EXPECT_TRUE(b["settings"]["ensemble"].is_null());
  EXPECT_EQ(benchmark_text(record, summary).find("Ensemble"), std::string::npos);
}

/// The rows of the first table, each cut into its cells.
std::vector<std::vector<std::string>> first_table(const BenchmarkRecord& record) {
  std::vector<std::vector<std::string>> rows;
  const std::vector<FigureTable> tables = benchmark_tables(record, BenchmarkSummary(record));
  for (const auto& row : tables.front().rows) {
    rows.emplace_back();
    for (const TableCell& cell : row) rows.back().push_back(cell.text);
  }
  return rows;
}

TEST(PublishedFigures, StandBesideOursForWholeFlightsOnly) {
  BenchmarkRecord record = ensemble();
  EXPECT_EQ(first_table(record).front().size(), 3u);  // a made-up flight: its name, error, time
  record.datasets = {{"room1", "tumvi_rooms", "tumvi_rooms/room1", {}},
                     {"room2", "tumvi_rooms", "tumvi_rooms/room2", {}}};
  record.runs.push_back(run_with(0.05, 100, 0.2, 1));
  record.runs.back().dataset = 1;
  using Row = std::vector<std::string>;
  const auto rows = first_table(record);
  ASSERT_EQ(rows.size(), 4u);
  EXPECT_EQ(rows[0], (Row{"room1", "0.0250", "–", "0.051", "0.067", "0.09", "–", "11.56", "20.19"}));
  EXPECT_EQ(rows[2], (Row{"mean", "0.0375", "–", "0.077", "0.068", "0.08", "–", "12.07", "21.43"}));
  record.datasets[1].name = "mine";  // its mean is of other flights than theirs
  EXPECT_EQ(first_table(record)[2], (Row{"mean", "0.0375", "–", "–", "–", "–", "–", "–", "–"}));
}

}  // namespace
}  // namespace epiline
