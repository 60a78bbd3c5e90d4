#pragma once
#include <vector>

#include "drivers/study/report/benchmark_record.h"
#include "drivers/study/report/figure_table.h"

namespace epiline {

/// The tables of a benchmark, in reading order: error and solve time for each group of data sets, time and work per
/// factor, ratios to the baseline, then every figure of every data set.
std::vector<FigureTable> benchmark_tables(const BenchmarkRecord& record, const BenchmarkSummary& summary);

}  // namespace epiline
