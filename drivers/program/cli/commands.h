#pragma once
// The commands of the program. Each function adds one to the command line; when it is chosen, its exit code lands in
// `exit_code`.
#include <CLI/CLI.hpp>

#include <memory>
#include <string>

#include "drivers/program/view/live_view.h"
#include "platform/error/result.h"

namespace epiline {

inline constexpr int kExitDone = 0, kExitRunFailed = 1, kExitUsage = 2;

/// Writes the one line of an error to stderr; returns the exit code that belongs to it.
int report(const Error& error);

/// The page of --view; null if none is asked for. Its address is printed in any case: whoever asks for a port that is
/// free has to know it.
Result<std::unique_ptr<LiveView>> open_view(const std::string& text);

void add_evaluate(CLI::App& app, int& exit_code);
void add_config(CLI::App& app, int& exit_code);
void add_dbc(CLI::App& app, int& exit_code);
void add_simulate(CLI::App& app, int& exit_code);
void add_run(CLI::App& app, int& exit_code);
void add_hil(CLI::App& app, int& exit_code);
void add_check(CLI::App& app, int& exit_code);
void add_replay(CLI::App& app, int& exit_code);
void add_benchmark(CLI::App& app, int& exit_code);
void add_montecarlo(CLI::App& app, int& exit_code);

}  // namespace epiline
