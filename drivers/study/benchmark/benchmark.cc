#include "drivers/study/benchmark/benchmark.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <fstream>

#include "drivers/flights/recordings/bag_dataset.h"
#include "drivers/study/benchmark/processes.h"
#include "drivers/study/report/benchmark_report.h"
#include "pipeline/config/config.h"
#include "pipeline/text/table.h"

namespace epiline {

namespace fs = std::filesystem;

namespace {

std::string processor_name() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    const std::size_t colon = line.find(": ");
    if (line.rfind("model name", 0) == 0 && colon != std::string::npos) return line.substr(colon + 2);
  }
  return "unknown processor";
}

/// A data set is named after its folder; `mav0` is the same for all.
BenchmarkDataset named(const fs::path& path) {
  std::error_code ignored;
  fs::path folder = fs::absolute(path, ignored).lexically_normal();
  if (folder.filename().empty()) folder = folder.parent_path();  // a trailing slash
  if (folder.filename() == "mav0") folder = folder.parent_path();
  return {folder.filename().string(), folder.parent_path().filename().string(), path.string(), {}};
}

/// Names appear in tables and as folders, so they must be unique.
void make_unique(std::vector<BenchmarkDataset>& datasets) {
  for (std::size_t i = 0; i < datasets.size(); ++i) {
    const std::string name = datasets[i].name;
    const auto taken = [&](const BenchmarkDataset& d) { return &d < &datasets[i] && d.name == datasets[i].name; };
    for (int n = 2; std::any_of(datasets.begin(), datasets.end(), taken); ++n)
      datasets[i].name = fmt::format("{}-{}", name, n);
  }
}

/// Repetitions outermost and factors innermost, so that runs that are compared run close together in time.
std::vector<BenchmarkRun> plan(const BenchmarkOptions& options, const std::vector<BenchmarkDataset>& datasets) {
  std::vector<BenchmarkRun> runs;
  const int repetitions = options.ensemble > 0 ? options.ensemble : options.repeat;
  for (int repetition = 1; repetition <= repetitions; ++repetition) {
    for (std::size_t d = 0; d < datasets.size(); ++d) {
      for (std::size_t f = 0; f < options.factors.size(); ++f) {
        BenchmarkRun run;
        run.dataset = d;
        run.factor = f;
        run.repetition = repetition;
        run.folder = fmt::format("runs/{}/{}/{}", datasets[d].name, options.factors[f], repetition);
        runs.push_back(std::move(run));
      }
    }
  }
  return runs;
}

ProcessJob job_of(const BenchmarkOptions& options, const BenchmarkRun& run) {
  const fs::path folder = options.out / run.folder;
  ProcessJob job{{"replay", options.datasets[run.dataset].string(), "--visual-factor", options.factors[run.factor],
                  "--camera", options.camera, "--out", folder.string(), "--quiet"},
                 folder};
  if (options.ensemble > 0)
    job.arguments.insert(job.arguments.end(), {"--perturb", std::to_string(run.repetition - 1)});
  if (!options.config_file.empty())
    job.arguments.insert(job.arguments.end(), {"--config", options.config_file.string()});
  return job;
}

/// The last line that the run printed, without the program's name.
std::string last_line(const fs::path& log) {
  std::ifstream in(log);
  std::string last;
  for (std::string line; std::getline(in, line);) {
    if (!line.empty()) last = line;
  }
  const std::string prefix = "epiline: error: ";
  return last.rfind(prefix, 0) == 0 ? last.substr(prefix.size()) : last;
}

/// Reads the files of the run.
void collect(const ProcessJob& job, const ProcessEnd& end, BenchmarkRun& run) {
  if (end.signal == 0 && end.exit_code == 2) {
    run.outcome = RunOutcome::kRefused;
    run.message = last_line(job.log());
    return;
  }
  if (const auto text = read_text(job.folder / "stats.json")) run.stats = Json::parse(*text, nullptr, false);
  if (run.stats.is_discarded()) run.stats = nullptr;
  const bool started = run.stats.is_object() && run.stats.value("/initialisation/done"_json_pointer, false);
  if (end.signal == 0 && end.exit_code == 0 && started) {
    auto estimate = read_trajectory(job.folder / "trajectory.tum");
    if (estimate) {
      run.outcome = RunOutcome::kDone;
      run.estimate = std::move(*estimate);
      std::error_code ignored;
      fs::remove(job.log(), ignored);  // the log of a successful run is of no interest
      return;
    }
    run.message = estimate.error().text();
  } else if (end.signal == 0 && run.stats.is_object() && !started) {
    run.outcome = RunOutcome::kNeverStarted;
    run.message = last_line(job.log());
  } else {
    run.message = end.signal != 0 ? fmt::format("ended by signal {} ({})", end.signal, strsignal(end.signal))
                                  : fmt::format("exit code {}: {}", end.exit_code, last_line(job.log()));
  }
}

}  // namespace

Result<BenchmarkRecord> run_benchmark(const BenchmarkOptions& options,
                                      const std::function<void(std::size_t, std::size_t)>& progress) {
  if (!options.config_file.empty()) {
    if (const auto file = ConfigFile::read(options.config_file); !file) return file.error();
  }
  BenchmarkRecord record;
  record.program = program_info();
  record.processor = processor_name();
  record.camera = options.camera;
  record.config = options.config_file.string();
  record.repeat = options.repeat;
  record.ensemble = options.ensemble;
  record.jobs = options.jobs;
  record.factors = options.factors;
  for (const fs::path& path : options.datasets) record.datasets.push_back(named(path));
  make_unique(record.datasets);
  record.runs = plan(options, record.datasets);
  std::vector<ProcessJob> jobs;
  for (const BenchmarkRun& run : record.runs) jobs.push_back(job_of(options, run));
  const auto ends = run_processes(jobs, options.jobs, progress);
  if (!ends) return ends.error();
  for (std::size_t i = 0; i < jobs.size(); ++i) collect(jobs[i], (*ends)[i], record.runs[i]);
  for (std::size_t d = 0; d < options.datasets.size(); ++d) {
    const fs::path& path = options.datasets[d];
    auto truth = is_bag(path) ? read_bag_ground_truth(path, "") : read_asl_ground_truth(path);
    if (truth) record.datasets[d].truth = std::move(*truth);  // the runs have reported what is wrong with it
  }
  return record;
}

Result<std::string> write_benchmark(const BenchmarkRecord& record, const fs::path& folder) {
  const BenchmarkSummary summary(record);
  std::string text = benchmark_text(record, summary);
  if (const Status s = make_folder(folder); !s) return s.error();
  if (const Status s = write_text(folder / "benchmark.json", benchmark_json(record, summary).dump(2) + "\n"); !s)
    return s.error();
  if (const Status s = write_text(folder / "benchmark.txt", text); !s) return s.error();
  if (const Status s = write_text(folder / "benchmark.html", benchmark_html(record, summary)); !s) return s.error();
  return text;
}

}  // namespace epiline
