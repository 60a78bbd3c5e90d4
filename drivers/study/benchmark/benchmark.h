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
  int repeat = 1, jobs = 1;           ///< jobs: replays side by side
  int ensemble = 0;                   ///< if above zero: so many runs, perturbed by 0, 1, ..., in place of `repeat`
  std::filesystem::path config_file;  ///< empty: defaults
  std::string camera = "cam0";
  std::filesystem::path out;  ///< the runs leave their files in `out/runs`
};

/// Runs all replays. A replay that fails is part of the result. `progress` is called with runs ended and runs in all.
/// Fails if and only if the configuration file is wrong, a folder cannot be written, a process cannot be started, or
/// the user interrupts.
Result<BenchmarkRecord> run_benchmark(const BenchmarkOptions& options,
                                      const std::function<void(std::size_t, std::size_t)>& progress);

/// Writes benchmark.json, benchmark.txt and benchmark.html; returns the text. Fails if and only if that is impossible.
Result<std::string> write_benchmark(const BenchmarkRecord& record, const std::filesystem::path& folder);

}  // namespace epiline
