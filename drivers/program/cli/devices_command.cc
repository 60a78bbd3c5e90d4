#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "drivers/program/cli/commands.h"
#include "drivers/program/inventory/parts.h"
#include "drivers/program/inventory/parts_json.h"

namespace epiline {

namespace {

int devices_command(bool as_json) {
  const Parts parts = find_parts();
  if (!as_json) {
    fmt::print("{}", to_text(parts));
    return kExitDone;
  }
  nlohmann::ordered_json root;
  root["schema"] = 1;
  root.update(to_json(parts));
  // device names may hold any bytes
  fmt::print("{}\n", root.dump(2, ' ', false, nlohmann::json::error_handler_t::replace));
  return kExitDone;
}

}  // namespace

void add_devices(CLI::App& app, int& exit_code) {
  const auto json = std::make_shared<bool>(false);
  CLI::App* command = app.add_subcommand(
      "devices", "List what is plugged in, with the setting that selects each part; needs no configuration");
  command->group(kFly);
  command->add_flag("--json", *json, "print the list as JSON");
  command->callback([json, &exit_code] { exit_code = devices_command(*json); });
}

}  // namespace epiline
