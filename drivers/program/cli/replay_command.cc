#include "drivers/study/replay/replay.h"
#include "drivers/study/report/outputs.h"
#include "drivers/study/report/own_parts.h"

#include <fmt/format.h>

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "drivers/program/cli/commands.h"
#include "drivers/program/cli/progress_bar.h"
#include "drivers/program/dds/dds_output.h"
#include "drivers/program/view/live_view.h"
#include "drivers/study/report/flight_mcap.h"
#include "drivers/study/report/stats_json.h"
#include "pipeline/config/config.h"
#include "pipeline/text/suspicion_text.h"
#include "pipeline/text/trajectory.h"
#include "platform/linux/end_request.h"

namespace epiline {

namespace {

struct ReplayArguments {
  ReplayOptions replay;
  std::string out = "epiline-out";
  std::vector<std::string> faults;
  double speed = 1;
  bool quiet = false, realtime = false, dds = false;
  std::string view;
  std::filesystem::path mcap;
  Foreign foreign = Foreign::kRefuse;
};

void print_realtime(const FlightRecord& r, const Timing& t) {
  const RealtimeReport& report = r.realtime->report;
  fmt::print("latency   {:.2f} ms median, {:.2f} ms 99 %, {:.2f} ms max, from image timestamp to odometry\n",
             t.latency.median, t.latency.p99, t.latency.max);
  fmt::print("threads   {} images in, {} overtaken, {} missed by the camera; page faults {}, heap calls {}, locks {}\n",
             report.frames_in, report.frames_overtaken, r.skipped.at("missed_by_camera"), r.page_faults,
             r.heap_calls ? std::to_string(*r.heap_calls) : "not counted",
             r.lock_calls ? std::to_string(*r.lock_calls) : "not counted");
  if (const auto& recorder = r.realtime->recorder) {
    for (const std::string& folder : recorder->written) fmt::print("record    {}\n", folder);
    for (const std::string& line : recorder->failed) fmt::print("note      record failed: {}\n", line);
  }
  fmt::print("imu rate  {} predictions, {:.2f} ms 99 %, {:.2f} ms max, from IMU sample to odometry\n", report.predicted,
             1e-6 * static_cast<double>(report.prediction_latency.quantile_ns(0.99)),
             1e-6 * static_cast<double>(report.prediction_latency.most_ns()));
  for (const std::string& line : r.realtime->shortfalls) fmt::print("note      {}\n", line);
}

void print_summary(const FlightRecord& r, const std::optional<TrajectoryErrors>& errors, const std::string& out) {
  const Timing t = timing_of(r);
  const auto start = start_seconds(r);
  fmt::print("images    {} read, {} solved, {} predicted\n", r.images_read, r.estimator.frames_solved,
             r.estimator.frames_predicted);
  if (start)
    fmt::print("start     {:.2f} s after the first image, coverage {:.1f} % since\n", *start,
               100 * coverage(r).value_or(0));
  if (errors && errors->poses > 0) {
    fmt::print("error     {:.4f} m rms over {:.1f} m (4-DoF alignment), scale {:+.2f} %, yaw drift {:+.2f} deg\n",
               errors->ate_4dof.rmse, errors->path_length_m, 100 * errors->scale_error, errors->yaw_drift_deg);
  }
  if (t.track.count > 0) fmt::print("track     {:.3f} ms mean, {:.3f} ms 99 %\n", t.track.mean, t.track.p99);
  for (std::size_t i = 0; i < r.others.size(); ++i) {
    const auto& other = r.others[i];
    if (!other || other->images == 0) continue;
    const double seen =
        static_cast<double>(other->views) / static_cast<double>(std::max<std::uint64_t>(1, other->tracks));
    fmt::print("cam{}      {}{:.0f} tracks of its own, {} images missing\n", i + 1,
               other->tracks > 0 ? fmt::format("{:.1f} % of another camera's tracks seen, ", 100 * seen) : "",
               static_cast<double>(other->alone) / static_cast<double>(other->images), other->images_missing);
  }
  fmt::print("solve     {:.3f} ms mean, {:.3f} ms 99 %\n", t.solve.mean, t.solve.p99);
  fmt::print("estimate  {:.3f} ms mean, {:.3f} ms 99 %\n", t.estimate.mean, t.estimate.p99);
  if (r.realtime) print_realtime(r, t);
  for (const std::string& text : texts_of(r.estimator.suspicions)) fmt::print("number    {}\n", text);
  if (const auto& f = r.load.frames; f[1] + f[2] + f[3] > 0)
    fmt::print("load      {} images in full, {} with fewer features, {} with fewer iterations, {} predicted only\n",
               f[0], f[1], f[2], f[3] - r.load.let_through);
  if (r.tracker && r.tracker->own_cells.own.any())
    fmt::print(
        "vehicle   seen in {:.0f} % of the image, which moves with the camera: no tracks begin there; {}/own_parts.png "
        "serves as camera.mask\n",
        100 * own_share(r.tracker->own_cells), out);
  fmt::print("report    {}/report.html\n", out);
}

std::string refusals(const EstimatorStats& stats) {
  std::string s;
  for (int i = 0; i < static_cast<int>(StartRefusal::kCount); ++i) {
    if (stats.start_refused[i] == 0) continue;
    s += fmt::format("{}{} {}", s.empty() ? "" : ", ", to_string(static_cast<StartRefusal>(i)), stats.start_refused[i]);
  }
  s = s.empty() ? "no start attempted" : "refused starts: " + s;
  for (const std::string& text : texts_of(stats.suspicions)) s += "; " + text;
  return s;
}

std::string fault_help() {
  std::string s = "simulate a sensor fault, NAME@SECONDS[:DURATION] after the first image; may be repeated. Names:";
  for (const FaultInfo& info : all_faults()) s += fmt::format("\n{}: {}", info.name, info.what);
  return s;
}

/// The file of --mcap, claimed as the folder of --out is.
Result<std::optional<OutputFolder>> claim_file(const std::filesystem::path& file, const std::filesystem::path& dataset,
                                               Foreign foreign) {
  if (file.empty()) return std::optional<OutputFolder>();
  std::error_code ignored;
  if (std::filesystem::equivalent(file, dataset, ignored))
    return Error{ErrorKind::kUsage, file.string(), 0, "is the recording that is read", "another file (--mcap)"};
  return claim(file.has_parent_path() ? file.parent_path() : ".", {file.filename().string()}, foreign);
}

/// What the run had estimated that left this record of the flight recorder; none of other recordings.
Result<std::optional<Trajectory>> flown_path(const std::filesystem::path& dataset) {
  std::error_code ignored;
  if (!std::filesystem::exists(dataset / "states.csv", ignored)) return std::optional<Trajectory>{};
  const std::filesystem::path path = dataset / "trajectory.tum";
  if (std::filesystem::file_size(path, ignored) == 0) return std::optional<Trajectory>{};  // lost all the time
  auto flown = read_trajectory(path);
  if (!flown) return flown.error();
  return std::optional<Trajectory>{std::move(*flown)};
}

int replay_command(ReplayArguments& options) {
  for (const std::string& text : options.faults) {
    const auto fault = fault_from(text);
    if (!fault) return report(fault.error());
    options.replay.faults.push_back(*fault);
  }
  if (options.realtime) options.replay.realtime_speed = options.speed;
  const auto folder = claim(options.out, kFlightFiles, options.foreign);
  if (!folder) return report(folder.error());
  const auto mcap_folder = claim_file(options.mcap, options.replay.dataset, options.foreign);
  if (!mcap_folder) return report(mcap_folder.error());
  const auto view = open_view(options.view);
  if (!view) return report(view.error());
  options.replay.view = view->get();
  std::optional<FlightMcap> mcap;
  std::optional<Trajectory> flown;
  if (!options.mcap.empty()) {
    auto path = flown_path(options.replay.dataset);
    if (!path) return report(path.error());
    flown = std::move(*path);
    options.replay.observer = &mcap.emplace(options.mcap);
    if (const Status s = mcap->status(); !s) return report(s.error());
  }
  std::optional<DdsOutput> dds;
  if (options.dds) {
    options.replay.observer = &dds.emplace(DdsOutput::Times::kAsRecorded);
    if (const Status s = dds->open(); !s) return report(s.error());
  }
  ProgressBar bar(options.quiet);
  std::size_t wanted = 0;
  std::optional<EndRequest> request;  // while the recording is read, a signal ends the program at once
  const auto result = replay(options.replay, [&](std::size_t done, std::size_t all) {
    if (!request) request.emplace();
    wanted = all;
    bar(done, all);
  });
  if (!result) return report(result.error());
  const FlightRecord& record = result->record;
  if (dds) dds->close();
  if (mcap)
    if (const Status s = mcap->finish(record.truth, flown); !s) return report(s.error());
  const auto errors = write_outputs(record, options.out);
  if (!errors) return report(errors.error());
  if (!options.quiet) {
    for (const std::string& note : result->notes) fmt::print("note      {}\n", note);
    print_summary(record, *errors, options.out);
    if (dds) fmt::print("dds       {} images sent, {} not sent\n", dds->sent(), dds->not_sent());
  }
  if (EndRequest::is_made()) return report_ended(record.images.size(), wanted, "images", options.out);
  if (!start_seconds(record)) {
    return report(
        {ErrorKind::kRun, record.dataset_path, 0,
         fmt::format("the estimator did not start in {} images ({})", record.images.size(), refusals(record.estimator)),
         "a second at rest, or motion with texture in view (docs/troubleshooting.md)"});
  }
  return kExitDone;
}

}  // namespace

void add_replay(CLI::App& app, int& exit_code) { add_tuned_replay(app, exit_code, {}); }

CLI::App& add_tuned_replay(CLI::App& app, int& exit_code, std::function<void(Config&)> tune) {
  const auto [command, o] =
      add_command(app, exit_code, kAnalyse, "replay",
                  "Estimate odometry from a recorded flight: trajectory, figures, report", replay_command);
  o->replay.tune = std::move(tune);
  command->add_option("DATASET", o->replay.dataset, "ASL folder (mav0/{cam0,imu0,...}), or bag (ROS 1, ROS 2, MCAP)")
      ->required();
  command->add_option("--out", o->out, "folder for the results")->capture_default_str();
  add_force(*command, o->foreign);
  add_settings(*command, o->replay.config_file, o->replay.set, "configuration file (TOML); epiline config prints one");
  command
      ->add_option("--camera", o->replay.camera,
                   "which camera of the data set; both: cam0 and cam1; all: cam0 and those after it, up to cam3")
      ->check(CLI::IsMember({"cam0", "cam1", "cam2", "cam3", kBothCameras, kAllCameras}))
      ->capture_default_str();
  command->add_option("--image-topic", o->replay.topics.image, "image topic of a bag; default: the first by name");
  command->add_option("--imu-topic", o->replay.topics.imu, "IMU topic of a bag; default: the first by name");
  command->add_option("--truth-topic", o->replay.topics.truth,
                      "ground-truth topic of a bag; default: the first with poses, if any");
  command->add_option("--start", o->replay.start_s, "skip this many seconds at the beginning")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--duration", o->replay.duration_s, "end after this many seconds")->check(CLI::PositiveNumber);
  command
      ->add_option("--deadline-ms", o->replay.deadline_ms,
                   "longest time for the solve of one image; makes the result depend on the computer")
      ->check(CLI::PositiveNumber);
  CLI::Option* const realtime =
      command->add_flag("--realtime", o->realtime, "replay in threads, each sample at its time, like a live flight");
  command->add_option("--speed", o->speed, "with --realtime: play this many times as fast")
      ->check(CLI::Range(0.01, 1000.0))
      ->needs(realtime);
  command
      ->add_option("--view", o->view, "with --realtime: serve a page that shows the flight; port 0 takes any free port")
      ->type_name("[ADDRESS:]PORT")
      ->needs(realtime);
  command
      ->add_flag(
          "--dds", o->dds,
          "with --realtime: publish odometry, transform and diagnostics for nodes of ROS 2, with the recording's times")
      ->needs(realtime);
  CLI::Option* const record = command
                                  ->add_option("--record", o->replay.record_folder,
                                               "with --realtime: flight recorder, writes records into this folder")
                                  ->needs(realtime);
  command->add_flag("--record-images", o->replay.record_images, "record images too")->needs(record);
  command
      ->add_option("--mcap", o->mcap,
                   "also write samples, images, estimate and ground truth into this MCAP file (ROS 2, Foxglove, rerun)")
      ->excludes(realtime);
  command
      ->add_option("--loop", o->replay.loop_s,
                   "repeat the recording for this many seconds, with a new start in each round")
      ->check(CLI::PositiveNumber);
  command
      ->add_flag("--imu-rate", o->replay.imu_rate,
                 "with --realtime: write odometry_imu_rate.tum, the odometry at every IMU sample")
      ->needs(realtime);
  command
      ->add_option("--perturb", o->replay.perturb,
                   "leave out this many images at the beginning and let the accelerometer measure as many times 1e-7 "
                   "more; nothing that matters, so the change of the errors is chance (./run benchmark --ensemble)")
      ->check(CLI::Range(0, 1000));
  command->add_option("--fault", o->faults, fault_help());
  command->add_flag("--quiet", o->quiet, "print errors only");
  return *command;
}

}  // namespace epiline
