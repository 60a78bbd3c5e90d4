#include <fmt/format.h>

#include <memory>
#include <string>

#include "drivers/links/can/dbc.h"
#include "drivers/program/cli/commands.h"
#include "pipeline/config/config.h"

namespace epiline {

namespace {

int dbc_command(const std::string& path) {
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
  const auto path = std::make_shared<std::string>();
  CLI::App* command = app.add_subcommand("dbc", "Print a DBC file that describes the CAN frames of odometry");
  command->group(kFly);
  command->add_option("--config", *path, "configuration file (TOML); can.base_id sets the identifiers");
  command->callback([path, &exit_code] { exit_code = dbc_command(*path); });
}

}  // namespace epiline
