#include <fmt/format.h>

#include <string>

#include "drivers/program/cli/commands.h"
#include "pipeline/config/config.h"

namespace epiline {

namespace {

struct ConfigArguments {
  std::string check;
  bool print_defaults = false;
};

int config_command(ConfigArguments& options) {
  Config config;
  if (!options.check.empty()) {
    const auto file = ConfigFile::read(options.check);
    if (!file) return report(file.error());
    file->apply(config);
  }
  fmt::print("{}", to_toml(config));
  return kExitDone;
}

}  // namespace

void add_config(CLI::App& app, int& exit_code) {
  const auto [command, options] = add_command(
      app, exit_code, kFly, "config",
      "Print every setting with its meaning, unit, range and default, as a configuration file", config_command);
  CLI::Option* defaults = command->add_flag("--print-defaults", options->print_defaults,
                                            "print all settings with their defaults, as without options");
  command->add_option("--check", options->check, "check a configuration file, and print all settings with its values")
      ->excludes(defaults);
}

}  // namespace epiline
