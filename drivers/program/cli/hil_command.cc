#include <fmt/format.h>

#include <charconv>
#include <cstdio>
#include <string>
#include <system_error>
#include <utility>

#include "drivers/program/cli/commands.h"
#include "drivers/program/cli/progress_bar.h"
#include "drivers/program/hil/hil_run.h"
#include "drivers/study/evaluate/errors.h"
#include "drivers/study/report/outputs.h"

namespace epiline {

namespace {

struct HilArguments {
  hil::HilOptions hil;
  bool quiet = false;
  Foreign foreign = Foreign::kRefuse;
};

void print_latency(const OutputRecord& output) {
  const auto ms = [&](double share) { return 1e-6 * static_cast<double>(output.latency.quantile_ns(share)); };
  fmt::print("output    {}: {} sent, {} not sent, reopened {} times\n", output.name, output.sent, output.not_sent,
             output.reopened);
  if (output.latency.count() == 0) return;
  fmt::print("latency   image timestamp to last byte, {} images: ", output.latency.count());
  for (const double percent : {10.0, 50.0, 90.0, 99.0, 99.9})
    fmt::print("{:.2f} ms {:g} %, ", ms(percent / 100), percent);
  fmt::print("{:.2f} ms max\n", 1e-6 * static_cast<double>(output.latency.most_ns()));
}

void print_flight(const FlightRecord& r) {
  const RealtimeReport& report = r.realtime->report;
  fmt::print("flight    {} images in, {} overtaken, {} estimated; {} IMU samples in\n", report.frames_in,
             report.frames_overtaken, report.frames_out, report.imu_in);
  for (const OutputRecord& output : r.realtime->outputs) print_latency(output);
  if (const auto errors = errors_of(r); errors && errors->poses > 0) {
    fmt::print("error     {:.4f} m rms over {:.1f} m (4-DoF alignment), {} poses, scale {:+.2f} %\n",
               errors->ate_4dof.rmse, errors->path_length_m, errors->poses, 100 * errors->scale_error);
  }
  for (const std::string& line : r.realtime->shortfalls) fmt::print("note      {}\n", line);
}

/// Each part for itself: a reset may turn and move the frame.
void print_received(const hil::HilResult& result) {
  const std::size_t parts = result.received.size();
  fmt::print("received  {} estimates{}\n", result.estimates,
             parts > 1 ? fmt::format(", {} resets, each part compared with the truth alone", parts - 1) : "");
  for (std::size_t i = 0; i < parts; ++i) {
    const TrajectoryErrors errors = evaluate(result.received[i], result.truth);
    if (errors.poses == 0) continue;
    fmt::print("received  {}{} poses, {:.4f} m rms off over {:.1f} m (4-DoF alignment)\n",
               parts > 1 ? fmt::format("part {}: ", i + 1) : "", errors.poses, errors.ate_4dof.rmse,
               errors.path_length_m);
  }
}

void print_summary(const hil::HilResult& result, hil::Releases judge) {
  fmt::print("{}", hil::text_of(result.verdict, result.begin, judge));
  fmt::print("played    {} images, {} late, {} refused; {} IMU samples refused\n", result.images_played,
             result.images_late, result.images_refused, result.readings_refused);
  if (result.record) print_flight(*result.record);
  print_received(result);
}

/// The user, or a script that waits for this line, starts the other process now.
void say_ready(const hil::HilOptions& options) {
  fmt::print("ready     {}, {}, {}; waiting for epiline run --config {}\n", options.camera, options.imu,
             options.controller, options.config_file.string());
  std::fflush(stdout);
}

int hil_command(HilArguments& options) {
  const auto config = find_config(options.hil.config_file);
  if (!config) return report(config.error());
  options.hil.config_file = *config;
  std::vector<std::string> names = {"verdict.txt", "received.tum", "truth.tum"};
  names.insert(names.end(), kFlightFiles.begin(), kFlightFiles.end());
  const auto folder = claim(options.hil.out, names, options.foreign);
  if (!folder) return report(folder.error());
  ProgressBar bar(options.quiet);
  constexpr std::size_t kSteps = 1000;
  bool said_ready = options.quiet;
  const auto result = hil::run_hil(options.hil, [&](const hil::Progress& progress) {
    if (progress.waits && !std::exchange(said_ready, true)) say_ready(options.hil);
    bar(static_cast<std::size_t>(progress.share * kSteps), kSteps);
  });
  if (!result) return report(result.error());
  bar(kSteps, kSteps);
  if (!options.quiet) print_summary(*result, options.hil.judge);
  const auto broken = result->verdict.broken(options.hil.judge);
  if (broken.empty()) return kExitDone;
  const hil::RuleVerdict& v = result->verdict.of(broken.front());
  return report({ErrorKind::kRun, options.hil.dataset.string(), 0,
                 fmt::format("the odometry breaks {} rules of the flight controllers, first of all {}: {}",
                             broken.size(), hil::info_of(v.rule).name, v.first),
                 hil::info_of(v.rule).demand});
}

std::string camera_fault(const std::string& text) {
  const bool good = text == "file" || text.rfind("v4l2loopback:/", 0) == 0;
  return good ? ""
              : "camera " + text +
                    "; expected file, or v4l2loopback:/dev/videoN with a device for each camera, separated by commas";
}

std::string judge_fault(const std::string& text) {
  if (hil::releases_from(text)) return "";
  return "judge " + text + "; expected px4, ardupilot, all or releases as --help lists them, separated by commas";
}

/// Only what opening the line would not report.
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
  const auto [command, o] = add_command(
      app, exit_code, kFly, "hil",
      "Play a recorded flight through the real interfaces, and judge the odometry by the rules of flight controllers",
      hil_command);
  hil::HilOptions& h = o->hil;
  command->add_option("DATASET", h.dataset, "ASL folder or bag, with images")->required();
  add_settings(*command, h.config_file, h.set,
               "configuration file (TOML) of epiline run; played devices replace its own; default: "
               "/etc/epiline/epiline.toml, else ./epiline.toml");
  command
      ->add_option("--camera", h.camera,
                   "file: images directly from the recording; v4l2loopback:DEVICE: through the kernel, with several "
                   "cameras a device for each, separated by commas")
      ->check(camera_fault)
      ->capture_default_str();
  command
      ->add_option("--imu", h.imu,
                   "file: samples directly from the recording; uhid: through the kernel's IIO; mavlink: from the "
                   "flight controller")
      ->check(CLI::IsMember({"file", "uhid", "mavlink"}))
      ->capture_default_str();
  command
      ->add_option(
          "--controller", h.controller,
          "where the simulated flight controller listens: pty[:PATH], udp[:PORT], a CAN interface, or a serial port "
          "that is wired to the configured one")
      ->check(controller_fault)
      ->capture_default_str();
  command->add_flag("--beside", h.beside,
                    "play and judge only, for an epiline run with the same configuration in another process");
  command
      ->add_option_function<std::string>(
          "--judge", [&h](const std::string& words) { h.judge = hil::releases_from(words).value_or(0); },
          "releases whose rules count, separated by commas: px4, ardupilot, all, or " + hil::release_options() +
              "; default: px4,ardupilot")
      ->check(judge_fault);
  command->add_option("--jitter-ms", h.disturbance.jitter_ms, "delay samples by up to this time")
      ->check(CLI::Range(0.0, 1000.0));
  command->add_option("--loss", h.disturbance.loss, "leave out this share of the samples")->check(CLI::Range(0.0, 1.0));
  command->add_flag("--burst", h.disturbance.bursts,
                    "each second, hold samples back for 80 ms and then play them at once");
  command->add_option("--skew-ppm", h.disturbance.skew_ppm, "let the IMU's clock run faster by this")
      ->check(CLI::Range(-1000.0, 1000.0));
  command->add_option("--start", h.start_s, "skip this many seconds at the beginning")->check(CLI::NonNegativeNumber);
  command->add_option("--duration", h.duration_s, "end after this many seconds")->check(CLI::PositiveNumber);
  command->add_option("--out", h.out, "write trajectory, events, figures, report and verdict into this folder");
  add_force(*command, o->foreign);
  command->add_flag("--quiet", o->quiet, "print errors only");
}

}  // namespace epiline
