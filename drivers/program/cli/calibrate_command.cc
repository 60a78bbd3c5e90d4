#include "drivers/study/calibrate/calibrate.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "drivers/program/cli/commands.h"
#include "drivers/program/cli/record_lines.h"
#include "drivers/program/inventory/config_edit.h"
#include "drivers/study/calibrate/board_detector.h"
#include "drivers/study/calibrate/calibration_files.h"
#include "platform/linux/end_request.h"

namespace epiline {

namespace {

struct CalibrateArguments {
  CalibrateSettings settings;
  std::string model, resolution;
  std::filesystem::path out, config;
  std::vector<std::string> set;
  bool json = false;
  Foreign foreign = Foreign::kRefuse;
  bool is_live() const { return settings.dataset.empty(); }
};

const std::map<std::string, CameraModel> kModels = {{"radial-tangential", CameraModel::kPinholeRadialTangential},
                                                    {"equidistant", CameraModel::kPinholeEquidistant},
                                                    {"double-sphere", CameraModel::kDoubleSphere}};

/// `752x480`. False if it is none.
bool parse_size(const std::string& text, int& width, int& height) {
  int read = 0;
  return std::sscanf(text.c_str(), "%dx%d%n", &width, &height, &read) == 2 &&  // NOLINT(cert-err34-c): read in full
         static_cast<std::size_t>(read) == text.size() && width > 0 && height > 0;
}

void print_text(const Calibration& calibration, const std::filesystem::path& out) {
  for (const Verdict& v : calibration.verdicts) {
    fmt::print("{:<20} {}  {}\n", v.what, v.good ? "good" : "POOR", v.found);
    if (!v.advice.empty()) fmt::print("{:<20}       to do better: {}\n", "", v.advice);
  }
  if (!out.empty()) fmt::print("written to {}: camera.yaml imu.yaml calibration.json report.html\n", out.string());
}

/// Both files with their whole paths: a service has another current folder. Numbers that the files hold now would be
/// overridden by older ones in the configuration, as the page of `epiline check` writes them.
Result<std::filesystem::path> set_calibrations(const std::filesystem::path& config, const std::filesystem::path& out) {
  const std::filesystem::path folder = std::filesystem::absolute(out).lexically_normal();
  return edit_config(config, {{"camera", "calibration", (folder / "camera.yaml").string()},
                              {"imu", "calibration", (folder / "imu.yaml").string()},
                              {"camera", "time_offset_s", "", EditKind::kUnset},
                              {"imu", "gyroscope_noise_density", "", EditKind::kUnset},
                              {"imu", "accelerometer_noise_density", "", EditKind::kUnset}});
}

Status check_arguments(const CalibrateArguments& a) {
  const auto wrong = [](const char* found, const char* expected) {
    return Error{ErrorKind::kUsage, "", 0, found, expected};
  };
  if (!a.config.empty() && a.out.empty())
    return wrong("--config without --out", "a folder for the files that it will name");
  if (!a.is_live()) {
    if (!a.set.empty()) return wrong("--set with a recording", "--set where --config names devices to record from");
    return Done{};
  }
  if (a.config.empty())
    return wrong("nothing to calibrate from", "a recording, or --config FILE that names camera and IMU");
  if (a.settings.board.empty())
    return wrong("no board", "--board FILE, the description of the board (epiline board writes one)");
  if (a.settings.start_s != 0) return wrong("--start without a recording", "--start where there is a recording");
  // check the board's description first, before the user waves the board
  const auto board = read_board(a.settings.board);
  if (!board) return board.error();
  const auto detector = BoardDetector::create(*board);
  return detector ? Status(Done{}) : Status(detector.error());
}

/// Waves go to disk first, as with `epiline record`: they can be calibrated again, with other options.
Status record_waves(CalibrateArguments& a) {
  a.settings.dataset = a.out / "recording";
  RecordOptions options;
  options.out = a.settings.dataset;
  options.duration_s = std::exchange(a.settings.duration_s, CalibrateSettings().duration_s);
  const bool says = !a.json;
  if (says && !std::isfinite(options.duration_s))
    fmt::print("record    until Ctrl-C: wave the rig before the board for a minute (docs/calibrate.md)\n");
  if (says) std::fflush(stdout);
  const auto summary = record_and_say(a.config, a.set, options, says);
  if (!summary) return summary.error();
  // Ctrl-C says that there are waves enough; the others, that the program is not wanted any more
  const std::string signal = EndRequest::signal_name(), kept = "the waves are in " + a.settings.dataset.string();
  set_end_text(kept.c_str());
  return signal.empty() || signal == "SIGINT" ? Status(Done{})
                                              : Error{ErrorKind::kRun, "", 0, "ended by " + signal + ", " + kept, ""};
}

int run_calibration(CalibrateArguments& arguments) {
  CalibrateSettings& settings = arguments.settings;
  if (!arguments.model.empty()) settings.model = kModels.at(arguments.model);
  if (!arguments.resolution.empty() && !parse_size(arguments.resolution, settings.width, settings.height)) {
    return report({ErrorKind::kUsage, "", 0, "--resolution " + arguments.resolution, "WIDTHxHEIGHT, as in 752x480"});
  }
  if (const Status s = check_arguments(arguments); !s) return report(s.error());
  const auto folder = claim(arguments.out, kCalibrationFiles, arguments.foreign);
  if (!folder) return report(folder.error());
  if (arguments.is_live()) {
    if (const Status s = record_waves(arguments); !s) return report(s.error());
  }
  const auto calibration = calibrate(settings);
  if (!calibration) return report(calibration.error());
  if (!arguments.out.empty()) {
    if (const Status s = write_calibration(*calibration, settings, arguments.out); !s) return report(s.error());
  }
  std::filesystem::path as_it_was;
  if (!arguments.config.empty()) {
    auto kept = set_calibrations(arguments.config, arguments.out);
    if (!kept) return report(kept.error());
    as_it_was = std::move(*kept);
  }
  if (arguments.json) {
    fmt::print("{}", calibration_json(*calibration, settings));
  } else {
    print_text(*calibration, arguments.out);
    if (!arguments.config.empty())
      fmt::print(
          "set in {}: camera.calibration imu.calibration, instead of any time offset and noise densities there (as it "
          "was: {})\n",
          arguments.config.string(), as_it_was.string());
  }
  return kExitDone;
}

}  // namespace

void add_calibrate(CLI::App& app, int& exit_code) {
  const auto [command, arguments] = add_command(
      app, exit_code, kFly, "calibrate",
      "Find lens, camera-IMU pose, time offset and IMU noise from a waved calibration board", run_calibration);
  CalibrateSettings& settings = arguments->settings;
  command->add_option(
      "DATASET", settings.dataset,
      "an ASL folder, as `epiline record` writes it. Without it, camera and IMU of --config are recorded into "
      "the folder `recording` of --out first, until Ctrl-C or for --duration");
  command->add_option("--out", arguments->out, "folder for camera.yaml, imu.yaml, calibration.json and report.html");
  add_force(*command, arguments->foreign);
  command->add_option("--config", arguments->config, "configuration to set both calibrations in");
  command
      ->add_option("--set", arguments->set,
                   "without DATASET: SECTION.KEY=VALUE, overrides one setting; may be repeated")
      ->type_name("SECTION.KEY=VALUE");
  command->add_option(
      "--board", settings.board,
      "the board: its description, as `epiline board` writes it, for images; target.csv for corners (default: the data "
      "set's)");
  command->add_option("--camera", settings.camera, "folder of the camera in the data set")->capture_default_str();
  command->add_option("--guess", settings.guess,
                      "camera calibration to start from; \"none\": nothing. Default: the data set's sensor.yaml");
  command->add_option("--model", arguments->model, "lens model; default: the guess's, else the one that fits best")
      ->check(CLI::IsMember(kModels));
  command->add_option("--resolution", arguments->resolution, "size of the images, where there are corners alone")
      ->type_name("WIDTHxHEIGHT");
  command->add_option("--imu", settings.imu_file, "the IMU's calibration; default: the data set's");
  command->add_flag("--hold-lens", settings.hold_lens, "keep the guess's lens, and find the rest");
  command->add_option("--start", settings.start_s, "leave out images before this time, s")->type_name("S");
  command
      ->add_option("--duration", settings.duration_s,
                   "leave out images after this much time, s; without DATASET: record so long")
      ->type_name("S");
  command->add_flag("--json", arguments->json, "print calibration.json instead of a summary");
}

}  // namespace epiline
