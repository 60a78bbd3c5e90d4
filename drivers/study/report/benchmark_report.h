#pragma once
#include <string>

#include "drivers/study/report/benchmark_record.h"

namespace epiline {

/// benchmark.json: settings, every run with all its figures, medians over the repetitions, ratios to the baseline.
Json benchmark_json(const BenchmarkRecord& record, const BenchmarkSummary& summary);

/// benchmark.txt: the tables.
std::string benchmark_text(const BenchmarkRecord& record, const BenchmarkSummary& summary);

/// benchmark.html: the tables, and for each data set the paths over the truth and the distribution of the position
/// error. One self-contained page; it links to the runs' own reports.
std::string benchmark_html(const BenchmarkRecord& record, const BenchmarkSummary& summary);

}  // namespace epiline
