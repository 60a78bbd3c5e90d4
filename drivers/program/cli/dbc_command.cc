#include <fmt/format.h>

#include <string>

#include "drivers/links/can/dbc.h"
#include "drivers/program/cli/commands.h"
#include "pipeline/config/config.h"

namespace epiline {

namespace {

int dbc_command(std::string& path) {
  Config config;
  if (!path.empty()) {
    const auto file = ConfigFile::read(path);
    if (!file) return report(file.error());
    file->apply(config);
  }
  fmt::print("{}", can::dbc_text(config.devices.can.base_id));
  return kExitDone;
}

}  // namespace

void add_dbc(CLI::App& app, int& exit_code) {
  const auto [command, path] = add_command(app, exit_code, kFly, "dbc",
                                           "Print a DBC file that describes the CAN frames of odometry", dbc_command);
  command->add_option("--config", *path, "configuration file (TOML); can.base_id sets the identifiers");
}

}  // namespace epiline
