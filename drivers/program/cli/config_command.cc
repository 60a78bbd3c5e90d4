#include <fmt/format.h>

#include <memory>
#include <string>

#include "drivers/program/cli/commands.h"
#include "pipeline/config/config.h"

namespace epiline {

namespace {

struct ConfigArguments {
  std::string check;
  bool print_defaults = false;
};

int config_command(const ConfigArguments& options) {
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
  const auto options = std::make_shared<ConfigArguments>();
  CLI::App* command =
      app.add_subcommand("config", "Every setting with its unit, range and meaning, as a configuration file");
  command->group(kFly);
  CLI::Option* defaults = command->add_flag("--print-defaults", options->print_defaults, "the defaults (the default)");
  command->add_option("--check", options->check, "checks a file and prints the settings it leads to")
      ->excludes(defaults);
  command->callback([options, &exit_code] { exit_code = config_command(*options); });
}

}  // namespace epiline
