#pragma once
// The commands of the program. Each function adds one to the command line; when it is chosen, its exit code lands in
// `exit_code`.
#include <CLI/CLI.hpp>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "drivers/program/view/live_view.h"
#include "platform/error/result.h"

namespace epiline {

inline constexpr int kExitDone = 0, kExitRunFailed = 1, kExitUsage = 2;

/// Writes the one line of an error to stderr; returns the exit code that belongs to it.
int report(const Error& error);

/// The page of --view; null if none is asked for. Its address is printed in any case: whoever asks for a port that is
/// free has to know it.
Result<std::unique_ptr<LiveView>> open_view(const std::string& text);

/// What a command does for its user; the help lists the commands by it.
inline constexpr char kFly[] = "Fly", kAnalyse[] = "Analyse a flight", kStudy[] = "Study many flights";

/// Adds --config and --set.
void add_settings(CLI::App& command, std::filesystem::path& file, std::vector<std::string>& set,
                  const std::string& what);
/// The configuration of a live run: the one given, else /etc/epiline/epiline.toml, else ./epiline.toml.
Result<std::filesystem::path> find_config(const std::filesystem::path& given);

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
