#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <thread>

#include "drivers/program/cli/commands.h"
#include "drivers/program/cli/progress_bar.h"
#include "drivers/study/benchmark/benchmark.h"
#include "pipeline/config/config.h"

namespace epiline {

namespace {

int benchmark_command(const BenchmarkOptions& options, Foreign foreign) {
  const auto folder = claim(options.out, {"benchmark.json", "benchmark.txt", "benchmark.html", "runs"}, foreign);
  if (!folder) return report(folder.error());
  ProgressBar bar(false, "runs");
  const auto record = run_benchmark(options, [&](std::size_t done, std::size_t all) { bar(done, all); });
  if (!record) return report(record.error());
  const auto text = write_benchmark(*record, options.out);
  if (!text) return report(text.error());
  fmt::print("{}\npage      {}\n", *text, (options.out / "benchmark.html").string());
  const auto done = [](const BenchmarkRun& run) { return run.outcome == RunOutcome::kDone; };
  if (std::any_of(record->runs.begin(), record->runs.end(), done)) return kExitDone;
  return report({ErrorKind::kRun, "", 0, fmt::format("none of {} runs gave a trajectory", record->runs.size()),
                 "at least one (benchmark.txt has the error of each run)"});
}

}  // namespace

void add_benchmark(CLI::App& app, int& exit_code) {
  const auto o = std::make_shared<BenchmarkOptions>();
  const auto foreign = std::make_shared<Foreign>(Foreign::kRefuse);
  o->factors.assign(kVisualFactorNames.begin(), kVisualFactorNames.end());
  o->jobs = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  CLI::App* command =
      app.add_subcommand("benchmark", "Replay every data set with every visual factor, and compare errors and times");
  command->group(kStudy);
  command->add_option("DATASET", o->datasets, "ASL folders or bags")->required();
  command->add_option("--factors", o->factors, "visual factors to compare")
      ->delimiter(',')
      ->check(CLI::IsMember(kVisualFactorNames))
      ->capture_default_str();
  CLI::Option* const repeat = command->add_option("--repeat", o->repeat, "number of runs of each")
                                  ->check(CLI::Range(1, 10000))
                                  ->capture_default_str();
  command
      ->add_option("--ensemble", o->ensemble,
                   "number of runs of each that differ by nothing that matters: each starts one image later; prints "
                   "medians with spreads, and whether the covariance covers the errors")
      ->check(CLI::Range(2, 1000))
      ->excludes(repeat);
  command->add_option("--jobs", o->jobs, "number of runs at the same time; 1 gives the cleanest times")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
  command->add_option("--config", o->config_file, "configuration file (TOML) of every run");
  command->add_option("--camera", o->camera, "which camera of the data sets")
      ->check(CLI::IsMember({"cam0", "cam1"}))
      ->capture_default_str();
  command->add_option("--out", o->out, "folder for the results")->required();
  add_force(*command, *foreign);
  command->callback([o, foreign, &exit_code] { exit_code = benchmark_command(*o, *foreign); });
}

}  // namespace epiline
