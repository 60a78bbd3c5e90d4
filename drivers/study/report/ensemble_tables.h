#pragma once
#include "drivers/study/report/benchmark_record.h"
#include "drivers/study/report/figure_table.h"

namespace epiline {

/// Errors of each data set and factor: median over an ensemble's runs, with the least and the largest.
FigureTable ensemble_table(const BenchmarkRecord& record, const BenchmarkSummary& summary);

/// How many of the ensemble's errors lie inside the regions that the covariance claims.
FigureTable calibration_table(const BenchmarkRecord& record, const BenchmarkSummary& summary);

}  // namespace epiline
