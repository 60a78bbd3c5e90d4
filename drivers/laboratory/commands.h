#pragma once
// The commands of `epiline-study`, as those of `epiline` are (drivers/program/cli/commands.h).
#include "drivers/program/cli/command_line.h"

namespace epiline {

void add_simulate(CLI::App& app, int& exit_code);
/// `epiline replay` with a choice of the visual factor.
void add_comparing_replay(CLI::App& app, int& exit_code);

}  // namespace epiline
