#include "drivers/study/calibrate/calibrate.h"

#include <fmt/format.h>

#include <map>
#include <memory>
#include <string>

#include "drivers/program/cli/commands.h"
#include "drivers/program/inventory/config_edit.h"
#include "drivers/study/calibrate/calibration_files.h"

namespace epiline {

namespace {

struct CalibrateArguments {
  CalibrateSettings settings;
  std::string model, resolution;
  std::filesystem::path out, config;
  bool json = false;
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

/// Both files with their whole paths: a service has another current folder.
Status set_calibrations(const std::filesystem::path& config, const std::filesystem::path& out) {
  const std::filesystem::path folder = std::filesystem::absolute(out).lexically_normal();
  return edit_config(config, {{"camera", "calibration", (folder / "camera.yaml").string()},
                              {"imu", "calibration", (folder / "imu.yaml").string()}});
}

int run_calibration(CalibrateArguments arguments) {
  CalibrateSettings& settings = arguments.settings;
  if (!arguments.model.empty()) settings.model = kModels.at(arguments.model);
  if (!arguments.resolution.empty() && !parse_size(arguments.resolution, settings.width, settings.height)) {
    return report({ErrorKind::kUsage, "", 0, "--resolution " + arguments.resolution, "WIDTHxHEIGHT, as in 752x480"});
  }
  if (!arguments.config.empty() && arguments.out.empty())
    return report({ErrorKind::kUsage, "", 0, "--config without --out", "a folder for the files that it will name"});
  const auto calibration = calibrate(settings);
  if (!calibration) return report(calibration.error());
  if (!arguments.out.empty()) {
    if (const Status s = write_calibration(*calibration, settings, arguments.out); !s) return report(s.error());
  }
  if (!arguments.config.empty()) {
    if (const Status s = set_calibrations(arguments.config, arguments.out); !s) return report(s.error());
  }
  if (arguments.json) {
    fmt::print("{}", calibration_json(*calibration, settings));
  } else {
    print_text(*calibration, arguments.out);
    if (!arguments.config.empty())
      fmt::print("set in {0}: camera.calibration imu.calibration (as it was: {0}.bak)\n", arguments.config.string());
  }
  return kExitDone;
}

}  // namespace

void add_calibrate(CLI::App& app, int& exit_code) {
  const auto arguments = std::make_shared<CalibrateArguments>();
  CalibrateSettings& settings = arguments->settings;
  CLI::App* command = app.add_subcommand(
      "calibrate", "Find lens, camera-IMU pose, time offset and IMU noise from a recording of a calibration board");
  command->group(kFly);
  command->add_option("DATASET", settings.dataset, "an ASL folder, as `epiline record` writes it")->required();
  command->add_option("--out", arguments->out, "folder for camera.yaml, imu.yaml, calibration.json and report.html");
  command->add_option("--config", arguments->config, "configuration to set both calibrations in");
  command->add_option(
      "--board", settings.board,
      "the board: Kalibr's description of an AprilGrid for images, target.csv for corners (default: the data set's)");
  command->add_option("--camera", settings.camera, "folder of the camera in the data set")->capture_default_str();
  command->add_option("--guess", settings.guess,
                      "camera calibration to start from; \"none\": nothing. Default: the data set's sensor.yaml");
  std::vector<std::string> names;
  for (const auto& [name, model] : kModels) names.push_back(name);
  command->add_option("--model", arguments->model, "lens model; default: the guess's, else the one that fits best")
      ->check(CLI::IsMember(names));
  command->add_option("--resolution", arguments->resolution, "size of the images, where there are corners alone")
      ->type_name("WIDTHxHEIGHT");
  command->add_option("--imu", settings.imu_file, "the IMU's calibration; default: the data set's");
  command->add_flag("--hold-lens", settings.hold_lens, "keep the guess's lens, and find the rest");
  command->add_option("--start", settings.start_s, "leave out images before this time, s")->type_name("S");
  command->add_option("--duration", settings.duration_s, "leave out images after this much time, s")->type_name("S");
  command->add_flag("--json", arguments->json, "print calibration.json instead of a summary");
  command->callback([arguments, &exit_code] { exit_code = run_calibration(*arguments); });
}

}  // namespace epiline
