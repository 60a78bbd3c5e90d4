#pragma once
// Every visual factor over every data set, each replay in a process of its own.
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "drivers/study/report/benchmark_record.h"
#include "platform/error/result.h"

namespace epiline {

struct BenchmarkOptions {
  std::vector<std::filesystem::path> datasets;
  std::vector<std::string> factors;
  int repeat = 1, jobs = 1;           ///< jobs: replays at the same time
  int ensemble = 0;                   ///< above zero: number of runs, perturbed by 0, 1, ..., instead of `repeat`
  std::filesystem::path config_file;  ///< empty: defaults
  std::string camera = "cam0";
  std::filesystem::path out;  ///< the runs write their files to `out/runs`
};

/// Runs all replays. A replay that fails is part of the result. Calls `progress` with ended and all runs.
/// Fails if and only if the configuration file is wrong, a folder cannot be written, a process cannot be started, or
/// the user interrupts.
Result<BenchmarkRecord> run_benchmark(const BenchmarkOptions& options,
                                      const std::function<void(std::size_t, std::size_t)>& progress);

/// Writes benchmark.json, benchmark.txt and benchmark.html; returns the text. Fails if and only if that is impossible.
Result<std::string> write_benchmark(const BenchmarkRecord& record, const std::filesystem::path& folder);

}  // namespace epiline
