#include "drivers/program/bench/bench.h"

#include "drivers/program/cli/commands.h"
#include "drivers/program/cli/progress_bar.h"
#include "drivers/program/cli/say.h"

namespace epiline {

namespace {

struct BenchArguments {
  double duration_s = 20;
};

int bench_command(BenchArguments& arguments) {
  ProgressBar bar(false);
  const BoardState before = board_state();
  BoardState after;
  const FlightRecord record = fly_made_up(arguments.duration_s, [&](std::size_t done, std::size_t all) {
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
  const auto [command, arguments] = add_command(
      app, exit_code, kAnalyse, "bench",
      "Measure this computer in ten seconds, without devices and data: `epiline bench`; whether it gets too hot: "
      "`epiline bench --duration 600`",
      bench_command);
  command
      ->add_option("--duration", arguments->duration_s,
                   "seconds of the flight, whose images and IMU samples are made up")
      ->check(CLI::Range(5.0, 3600.0))
      ->capture_default_str();
}

}  // namespace epiline
