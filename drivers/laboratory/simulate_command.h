#pragma once
#include <CLI/CLI.hpp>

namespace epiline {

/// Adds the command `simulate`, as drivers/program/cli/commands.h says.
void add_simulate(CLI::App& app, int& exit_code);

}  // namespace epiline
