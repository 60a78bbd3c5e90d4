#pragma once
// What the commands of our programs share.
#include <CLI/CLI.hpp>

#include <filesystem>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "drivers/program/view/live_view.h"
#include "pipeline/text/output_folder.h"
#include "platform/error/result.h"

namespace epiline {

inline constexpr int kExitDone = 0, kExitRunFailed = 1, kExitUsage = 2;

/// Writes the error to stderr, on one line; returns its exit code. After a command line with --json, stdout gets it
/// too, as
/// {"schema": 1, "error": {"kind", "file", "line", "found", "expected"}}: `kind` is "usage" or "run", `line` may be
/// null.
int report(const Error& error);
/// After a signal asked the command to end: reports how far it came, as in "ended by SIGTERM after 12 of 60 images",
/// and what is in `out`.
int report_ended(std::size_t done, std::size_t all, const std::string& unit, const std::string& out);

/// The page of --view; null without the option. Prints the address, because port 0 takes any free port.
Result<std::unique_ptr<LiveView>> open_view(const std::string& text);

/// Headings under which the help lists the commands.
inline constexpr char kFly[] = "Fly", kAnalyse[] = "Analyse a flight";

/// Adds a command under a heading of the help. Its options fill the arguments; `run` then gives the exit code.
template <class Arguments>
std::pair<CLI::App*, Arguments*> add_command(CLI::App& app, int& exit_code, const char* heading, const char* name,
                                             const char* help, int (*run)(Arguments&)) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* const command = app.add_subcommand(name, help)->group(heading);
  command->callback([arguments, run, &exit_code] { exit_code = run(*arguments); });
  return {command, arguments.get()};
}

/// Prints it for a script. Names of devices and files may hold any bytes.
void print_json(const nlohmann::ordered_json& root);

/// Adds --force.
void add_force(CLI::App& command, Foreign& foreign);
/// The folder of --out, claimed before the work begins; none without --out.
Result<std::optional<OutputFolder>> claim(const std::filesystem::path& folder, const std::vector<std::string>& names,
                                          Foreign foreign);

/// Adds --config (with the help `what`) and --set.
void add_settings(CLI::App& command, std::filesystem::path& file, std::vector<std::string>& set,
                  const std::string& what);
/// The configuration of a live flight: `given`, else /etc/epiline/epiline.toml, else ./epiline.toml.
Result<std::filesystem::path> find_config(const std::filesystem::path& given);

/// The program `name`: the commands that `add` adds; running one sets the exit code, which this returns.
int run_program(int argc, char** argv, const char* name, const char* description,
                const std::function<void(CLI::App&, int&)>& add);

}  // namespace epiline
