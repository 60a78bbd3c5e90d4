#include "drivers/program/bench/bench.h"

#include <memory>

#include "drivers/program/cli/commands.h"
#include "drivers/program/cli/progress_bar.h"
#include "drivers/program/cli/say.h"

namespace epiline {

namespace {

int bench_command(double duration_s) {
  ProgressBar bar(false);
  const BoardState before = board_state();
  BoardState after;
  const FlightRecord record = fly_made_up(duration_s, [&](std::size_t done, std::size_t all) {
    bar(done, all);
    if (done == all) after = board_state();  // before the processor slows down again
  });
  const auto error = position_error(record);
  if (!error) return report(error.error());
  say("{}", bench_text(record, *error, board_name(), before, after));
  return kExitDone;
}

}  // namespace

void add_bench(CLI::App& app, int& exit_code) {
  const auto duration_s = std::make_shared<double>(20);
  CLI::App* command = app.add_subcommand(
      "bench",
      "Measure this computer in ten seconds, without devices and data: `epiline bench`; whether it gets too hot: "
      "`epiline bench --duration 600`");
  command->group(kAnalyse);
  command->add_option("--duration", *duration_s, "seconds of the flight, whose images and IMU samples are made up")
      ->check(CLI::Range(5.0, 3600.0))
      ->capture_default_str();
  command->callback([duration_s, &exit_code] { exit_code = bench_command(*duration_s); });
}

}  // namespace epiline
