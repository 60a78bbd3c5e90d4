#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "drivers/program/check/check.h"
#include "drivers/program/cli/commands.h"
#include "pipeline/config/config.h"

namespace epiline {

namespace {

struct CheckArguments {
  std::filesystem::path config;
  std::vector<std::string> set;
  double seconds = 10;
  bool json = false;
};

void print_lines(const Findings& findings, const Inventory& inventory) {
  for (const Finding& f : findings) {
    fmt::print("{:7}  {}: {}{}{}\n", kGradeNames[static_cast<std::size_t>(f.grade)], f.device, f.text,
               f.remedy.empty() ? "" : "; ", f.remedy);
  }
  fmt::print("present  cameras: {}\n", to_text(inventory.cameras));
  fmt::print("present  iio: {}\n", to_text(inventory.iio));
  fmt::print("present  spi: {}\n", to_text(inventory.spi));
  fmt::print("present  gpio: {}\n", to_text(inventory.gpio));
  fmt::print("present  serial: {}\n", to_text(inventory.serial));
  fmt::print("present  can: {}\n", to_text(inventory.can));
}

void print_json(const Findings& findings, const Inventory& inventory) {
  nlohmann::ordered_json root;
  root["schema"] = 1;
  root["findings"] = nlohmann::ordered_json::array();
  for (const Finding& f : findings) {
    nlohmann::ordered_json entry;
    entry["grade"] = kGradeNames[static_cast<std::size_t>(f.grade)];
    entry["device"] = f.device;
    entry["text"] = f.text;
    entry["remedy"] = f.remedy;
    root["findings"].push_back(entry);
  }
  const auto list = [](const std::vector<ListedDevice>& devices) {
    auto all = nlohmann::ordered_json::array();
    for (const ListedDevice& d : devices) all.push_back({{"path", d.path}, {"name", d.name}});
    return all;
  };
  root["present"]["cameras"] = list(inventory.cameras);
  root["present"]["iio"] = list(inventory.iio);
  root["present"]["spi"] = list(inventory.spi);
  root["present"]["gpio"] = list(inventory.gpio);
  root["present"]["serial"] = list(inventory.serial);
  root["present"]["can"] = list(inventory.can);
  // device names may hold any bytes
  fmt::print("{}\n", root.dump(2, ' ', false, nlohmann::json::error_handler_t::replace));
}

int check(const CheckArguments& options) {
  const auto config = find_config(options.config);
  if (!config) return report(config.error());
  // an error in the configuration is wrong input, not a finding about a device
  if (const auto file = ConfigFile::read(*config, options.set); !file) return report(file.error());
  CheckOptions how;
  how.set = options.set;
  how.seconds = options.seconds;
  const bool shows = isatty(STDERR_FILENO) == 1;
  how.watch = [&](double seconds) {
    if (shows) {
      const bool first_half = seconds < options.seconds / 2;
      fmt::print(stderr, "\r\x1b[K{:3.0f} of {:.0f} s: {}", seconds, options.seconds,
                 first_half ? "keep it at rest" : "turn it by hand about all three axes");
    }
    return true;
  };
  const Findings findings = check_devices(*config, how);
  if (shows) fmt::print(stderr, "\r\x1b[K");
  const Inventory inventory = list_devices();
  if (options.json)
    print_json(findings, inventory);
  else
    print_lines(findings, inventory);
  const bool is_bad =
      std::any_of(findings.begin(), findings.end(), [](const Finding& f) { return f.grade == Grade::kError; });
  return is_bad ? kExitRunFailed : kExitDone;
}

}  // namespace

void add_check(CLI::App& app, int& exit_code) {
  const auto options = std::make_shared<CheckArguments>();
  CLI::App* command = app.add_subcommand("check", "Test the configured devices, and say what is wrong and what to do");
  command->group(kFly);
  add_settings(*command, options->config, options->set,
               "configuration file (TOML) of epiline run; default: /etc/epiline/epiline.toml, else ./epiline.toml");
  command
      ->add_option("--seconds", options->seconds,
                   "how long to watch the data (default 10); an hour at rest gives the Allan deviation")
      ->check(CLI::Range(1.0, 86400.0));
  command->add_flag("--json", options->json, "print the findings as JSON");
  command->callback([options, &exit_code] { exit_code = check(*options); });
}

}  // namespace epiline
