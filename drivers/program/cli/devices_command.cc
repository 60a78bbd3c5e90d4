#include <fmt/format.h>

#include "drivers/program/cli/commands.h"
#include "drivers/program/inventory/parts.h"
#include "drivers/program/inventory/parts_json.h"

namespace epiline {

namespace {

int devices_command(bool& as_json) {
  const Parts parts = find_parts();
  if (!as_json) {
    fmt::print("{}", to_text(parts));
    return kExitDone;
  }
  nlohmann::ordered_json root;
  root["schema"] = 1;
  root.update(to_json(parts));
  print_json(root);
  return kExitDone;
}

}  // namespace

void add_devices(CLI::App& app, int& exit_code) {
  const auto [command, json] = add_command(
      app, exit_code, kFly, "devices",
      "List what is plugged in, with the setting that selects each part; needs no configuration", devices_command);
  command->add_flag("--json", *json, "print the list as JSON");
}

}  // namespace epiline
