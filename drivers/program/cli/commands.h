#pragma once
// The commands of the program. Each function adds one command to the command line; running the command sets
// `exit_code`.
#include <functional>

#include "drivers/program/cli/command_line.h"
#include "pipeline/config/config.h"

namespace epiline {

void add_evaluate(CLI::App& app, int& exit_code);
void add_bench(CLI::App& app, int& exit_code);
void add_config(CLI::App& app, int& exit_code);
void add_dbc(CLI::App& app, int& exit_code);
void add_run(CLI::App& app, int& exit_code);
void add_hil(CLI::App& app, int& exit_code);
void add_devices(CLI::App& app, int& exit_code);
void add_record(CLI::App& app, int& exit_code);
void add_init(CLI::App& app, int& exit_code);
void add_check(CLI::App& app, int& exit_code);
void add_board(CLI::App& app, int& exit_code);
void add_calibrate(CLI::App& app, int& exit_code);
void add_replay(CLI::App& app, int& exit_code);
/// The same command of epiline-study. `tune`: ReplayOptions::tune; returns the command, for further options.
CLI::App& add_tuned_replay(CLI::App& app, int& exit_code, std::function<void(Config&)> tune);

}  // namespace epiline
