#include <fmt/format.h>

#include <charconv>
#include <cstdio>
#include <memory>
#include <string>
#include <system_error>
#include <utility>

#include "drivers/program/cli/commands.h"
#include "drivers/program/cli/progress_bar.h"
#include "drivers/program/hil/hil_run.h"
#include "drivers/study/evaluate/errors.h"

namespace epiline {

namespace {

struct HilArguments {
  hil::HilOptions hil;
  bool quiet = false;
};

void print_latency(const OutputRecord& output) {
  const auto ms = [&](double share) { return 1e-6 * static_cast<double>(output.latency.quantile_ns(share)); };
  fmt::print("output    {}: {} sent, {} not sent, reopened {} times\n", output.name, output.sent, output.not_sent,
             output.reopened);
  if (output.latency.count() == 0) return;
  fmt::print("latency   image stamp to last byte, {} images: ", output.latency.count());
  for (const double percent : {10.0, 50.0, 90.0, 99.0, 99.9})
    fmt::print("{:.2f} ms {:g} %, ", ms(percent / 100), percent);
  fmt::print("{:.2f} ms at most\n", 1e-6 * static_cast<double>(output.latency.most_ns()));
}

void print_flight(const FlightRecord& r) {
  const RealtimeReport& report = r.realtime->report;
  fmt::print("flight    {} images in, {} overtaken, {} estimated; {} readings in\n", report.frames_in,
             report.frames_overtaken, report.frames_out, report.imu_in);
  for (const OutputRecord& output : r.realtime->outputs) print_latency(output);
  if (const auto errors = errors_of(r); errors && errors->poses > 0) {
    fmt::print("error     {:.4f} m rms over {:.1f} m (4-DoF alignment), {} poses, scale {:+.2f} %\n",
               errors->ate_4dof.rmse, errors->path_length_m, errors->poses, 100 * errors->scale_error);
  }
  for (const std::string& line : r.realtime->shortfalls) fmt::print("note      {}\n", line);
}

void print_summary(const hil::HilResult& result) {
  fmt::print("{}", hil::text_of(result.verdict, result.begin));
  fmt::print("played    {} images, {} late, {} refused; {} readings refused\n", result.images_played,
             result.images_late, result.images_refused, result.readings_refused);
  if (result.record) print_flight(*result.record);
  const TrajectoryErrors errors = evaluate(result.received, result.truth);
  fmt::print("received  {} estimates", result.estimates);
  if (errors.poses > 0)
    fmt::print(", {:.4f} m rms off over {:.1f} m (4-DoF alignment)", errors.ate_4dof.rmse, errors.path_length_m);
  fmt::print("\n");
}

/// Somebody starts the other process now, or waits for this line to do so.
void say_ready(const hil::HilOptions& options) {
  fmt::print("ready     {}, {}, {}; waits for epiline run --config {}\n", options.camera, options.imu,
             options.controller, options.config_file.string());
  std::fflush(stdout);
}

int hil_command(HilArguments& options) {
  const auto config = find_config(options.hil.config_file);
  if (!config) return report(config.error());
  options.hil.config_file = *config;
  ProgressBar bar(options.quiet);
  constexpr std::size_t kSteps = 1000;
  bool said_ready = options.quiet;
  const auto result = hil::run_hil(options.hil, [&](const hil::Progress& progress) {
    if (progress.waits && !std::exchange(said_ready, true)) say_ready(options.hil);
    bar(static_cast<std::size_t>(progress.share * kSteps), kSteps);
    return true;
  });
  if (!result) return report(result.error());
  bar(kSteps, kSteps);
  if (!options.quiet) print_summary(*result);
  if (result->verdict.accepted()) return kExitDone;
  const hil::RuleVerdict& v = result->verdict.of(result->verdict.broken().front());
  return report({ErrorKind::kRun, options.hil.dataset.string(), 0,
                 fmt::format("{} of the controllers' rules are broken, the first: {}: {}",
                             result->verdict.broken().size(), hil::info_of(v.rule).name, v.first),
                 hil::info_of(v.rule).demand});
}

std::string camera_fault(const std::string& text) {
  const bool good = text == "file" || text.rfind("v4l2loopback:/", 0) == 0;
  return good ? "" : "camera " + text + "; expected file or v4l2loopback:/dev/videoN";
}

/// Of what cannot be left to whoever opens it.
std::string controller_fault(const std::string& text) {
  if (text.empty()) return "no controller; expected pty, udp, a CAN interface or a serial port";
  if (text.rfind("udp:", 0) != 0) return "";
  int port = 0;
  const char* const end = text.data() + text.size();
  const auto read = std::from_chars(text.data() + 4, end, port);
  const bool good = read.ec == std::errc() && read.ptr == end && port > 0 && port < 65'536;
  return good ? "" : "controller " + text + "; expected udp:PORT";
}

}  // namespace

void add_hil(CLI::App& app, int& exit_code) {
  const auto o = std::make_shared<HilArguments>();
  hil::HilOptions& h = o->hil;
  CLI::App* command = app.add_subcommand(
      "hil", "Plays a recorded flight through the real interfaces, and judges the odometry as flight controllers do");
  command->add_option("DATASET", h.dataset, "ASL folder or ROS 1 bag, with images")->required();
  command->group(kFly);
  add_settings(*command, h.config_file, h.set,
               "the configuration of epiline run (TOML), whose devices are replaced by what is played; default: "
               "/etc/epiline/epiline.toml, else ./epiline.toml");
  command->add_option("--camera", h.camera, "file, or v4l2loopback:DEVICE: through the kernel")
      ->check(camera_fault)
      ->capture_default_str();
  command->add_option("--imu", h.imu, "file; uhid: through the kernel's IIO; mavlink: that of the controller")
      ->check(CLI::IsMember({"file", "uhid", "mavlink"}))
      ->capture_default_str();
  command
      ->add_option("--controller", h.controller,
                   "where the flight controller is played: pty[:PATH], udp[:PORT], vcan..., or a serial port that is "
                   "wired to the configuration's")
      ->check(controller_fault)
      ->capture_default_str();
  command->add_flag("--beside", h.beside,
                    "plays and judges only: an epiline run beside this flies, with the same configuration");
  command->add_option("--jitter-ms", h.disturbance.jitter_ms, "samples come late by up to so much")
      ->check(CLI::Range(0.0, 1000.0));
  command->add_option("--loss", h.disturbance.loss, "share of samples that do not come")->check(CLI::Range(0.0, 1.0));
  command->add_flag("--burst", h.disturbance.bursts, "each second nothing for 80 ms, then all of it at once");
  command->add_option("--skew-ppm", h.disturbance.skew_ppm, "the IMU's clock runs so much faster")
      ->check(CLI::Range(-1000.0, 1000.0));
  command->add_option("--start", h.start_s, "seconds of images left out at the beginning")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--duration", h.duration_s, "ends after that many seconds")->check(CLI::PositiveNumber);
  command->add_option("--out", h.out, "folder for trajectory, events, figures, report and verdict");
  command->add_flag("--quiet", o->quiet, "no summary, no progress");
  command->callback([o, &exit_code] { exit_code = hil_command(*o); });
}

}  // namespace epiline
