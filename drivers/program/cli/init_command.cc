#include <fmt/format.h>

#include <filesystem>
#include <string>

#include "drivers/program/cli/commands.h"
#include "drivers/program/inventory/draft.h"
#include "drivers/program/inventory/probe.h"

namespace epiline {

namespace {

struct InitArguments {
  std::filesystem::path out = "epiline.toml";
  bool force = false, probes = true;
};

void print_result(const Draft& draft, const std::string& file) {
  for (const std::string& line : draft.chosen) fmt::print("{}\n", line);
  for (const std::string& line : draft.missing) fmt::print("missing   {}\n", line);
  fmt::print("written   {}\n\nNext:\n", file);
  fmt::print("  epiline record --config {} --out board        # wave the camera in front of a board\n", file);
  fmt::print("  epiline calibrate board --board board.yaml --out calibration --config {}\n", file);
  fmt::print("  epiline check --config {}\n", file);
}

int init_command(InitArguments& options) {
  Parts parts = find_parts();
  if (options.probes) probe(parts, Probes::of_this_computer());
  const auto draft = draft_configuration(parts);
  if (!draft) return report(draft.error());
  if (const Status s = write_draft(*draft, options.out, options.force); !s) return report(s.error());
  print_result(*draft, options.out.string());
  return kExitDone;
}

}  // namespace

void add_init(CLI::App& app, int& exit_code) {
  const auto [command, options] =
      add_command(app, exit_code, kFly, "init",
                  "Write a configuration from what is plugged in, with a reason for each choice", init_command);
  command->add_option("--out", options->out, "file to write")->capture_default_str();
  command->add_flag("--force", options->force, "replace the file if it is there; the old one is kept as FILE.bak");
  command->add_flag_callback(
      "--no-probe", [o = options] { o->probes = false; },
      "do not ask chips on SPI for their identity, and do not listen at serial ports");
}

}  // namespace epiline
