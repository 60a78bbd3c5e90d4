#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "drivers/program/check/check.h"
#include "drivers/program/cli/commands.h"
#include "drivers/program/cli/say.h"
#include "drivers/program/inventory/config_edit.h"
#include "drivers/program/live/devices.h"
#include "drivers/program/view/check_view.h"
#include "pipeline/config/config.h"
#include "platform/linux/signals.h"

namespace epiline {

namespace {

struct CheckArguments {
  std::filesystem::path config;
  std::vector<std::string> set;
  std::optional<double> seconds;  ///< not given: ten, or as long as the page is served
  std::string view;
  bool json = false;
};

constexpr std::pair<const char*, std::vector<ListedDevice> Inventory::*> kPresent[] = {
    {"cameras", &Inventory::cameras}, {"iio", &Inventory::iio},       {"spi", &Inventory::spi},
    {"gpio", &Inventory::gpio},       {"serial", &Inventory::serial}, {"can", &Inventory::can}};

void print_lines(const Findings& findings, const Inventory& inventory) {
  for (const Finding& f : findings) {
    fmt::print("{:7}  {}: {}{}{}\n", kGradeNames[static_cast<std::size_t>(f.grade)], f.device, f.text,
               f.remedy.empty() ? "" : "; ", f.remedy);
  }
  for (const auto& [name, devices] : kPresent) fmt::print("present  {}: {}\n", name, to_text(inventory.*devices));
}

nlohmann::ordered_json json_of(const Findings& findings, const Inventory& inventory) {
  nlohmann::ordered_json root;
  root["schema"] = 1;
  root["findings"] = nlohmann::ordered_json::array();
  for (const Finding& f : findings) {
    root["findings"].push_back({{"grade", kGradeNames[static_cast<std::size_t>(f.grade)]},
                                {"device", f.device},
                                {"text", f.text},
                                {"remedy", f.remedy}});
  }
  for (const auto& [name, devices] : kPresent) {
    auto& all = root["present"][name] = nlohmann::ordered_json::array();
    for (const ListedDevice& d : inventory.*devices) all.push_back({{"path", d.path}, {"name", d.name}});
  }
  return root;
}

int print(const Findings& findings, bool json) {
  const Inventory inventory = list_devices();
  if (json)
    print_json(json_of(findings, inventory));
  else
    print_lines(findings, inventory);
  const bool is_bad =
      std::any_of(findings.begin(), findings.end(), [](const Finding& f) { return f.grade == Grade::kError; });
  return is_bad ? kExitRunFailed : kExitDone;
}

/// Opens the page, which may write findings into the configuration.
Result<std::unique_ptr<CheckView>> open_check_view(const std::string& address_text, const std::filesystem::path& config,
                                                   const std::vector<std::string>& set) {
  const auto address = parse_view_address(address_text);
  if (!address) return address.error();
  const auto settings = read_live_settings(config, set, CalibrationNeed::kIfGiven);
  if (!settings) return settings.error();
  const ImuNoise& noise = settings->config.estimator.imu;
  auto view = CheckView::open(
      *address,
      {config.string(), "epiline " EPILINE_VERSION, noise.gyroscope_density, noise.accelerometer_density, false},
      [config](const SettingHint& hint) {
        const auto kept =
            edit_config(config, {{hint.section, hint.key, fmt::format("{:.6g}", hint.value), EditKind::kNumber}});
        return kept ? Status(Done{}) : Status(kept.error());
      });
  if (!view) return view.error();
  for (const std::string& url : urls_of((*view)->address())) say("view      {}\n", url);
  return view;
}

int check_command(CheckArguments& options) {
  const auto config = find_config(options.config);
  if (!config) return report(config.error());
  // an error in the configuration is wrong input, not a finding about a device
  if (const auto file = ConfigFile::read(*config, options.set); !file) return report(file.error());
  CheckOptions how;
  how.set = options.set;
  std::unique_ptr<CheckView> view;
  const EndSignals signals;  // before any thread begins
  if (!options.view.empty()) {
    if (options.json) return report({ErrorKind::kUsage, "", 0, "--json with --view", "one of them"});
    auto opened = open_check_view(options.view, *config, options.set);
    if (!opened) return report(opened.error());
    view = std::move(*opened);
    how.witness = view.get();
  }
  how.seconds = options.seconds.value_or(view != nullptr ? std::numeric_limits<double>::infinity() : 10);
  const bool shows = view == nullptr && isatty(STDERR_FILENO) == 1;
  how.watch = [&](double seconds) {
    if (shows) {
      const bool first_half = seconds < how.seconds / 2;
      fmt::print(stderr, "\r\x1b[K{:3.0f} of {:.0f} s: {}", seconds, how.seconds,
                 first_half ? "keep it at rest" : "turn it by hand about all three axes");
    }
    return !signals.ends(signals.wait({}));
  };
  const Findings findings = check_devices(*config, how);
  if (shows) fmt::print(stderr, "\r\x1b[K");
  const int code = print(findings, options.json);
  const std::string signal = EndRequest::signal_name();
  if (signal.empty() || !std::isfinite(how.seconds)) return code;
  say(stderr, "epiline: error: ended by {} before the {:.0f} s of the check were over\n", signal, how.seconds);
  return kExitRunFailed;
}

}  // namespace

void add_check(CLI::App& app, int& exit_code) {
  const auto [command, options] =
      add_command(app, exit_code, kFly, "check", "Test the configured devices, and say what is wrong and what to do",
                  check_command);
  add_settings(*command, options->config, options->set,
               "configuration file (TOML) of epiline run; default: /etc/epiline/epiline.toml, else ./epiline.toml");
  command
      ->add_option("--seconds", options->seconds,
                   "how long to watch the data (default 10, with --view until Ctrl-C); an hour at rest gives the Allan "
                   "deviation")
      ->check(CLI::Range(1.0, 86400.0));
  command
      ->add_option("--view", options->view,
                   "serve a page that shows camera, IMU and findings meanwhile; port 0 takes any free port")
      ->type_name("[ADDRESS:]PORT");
  command->add_flag("--json", options->json, "print the findings as JSON");
}

}  // namespace epiline
