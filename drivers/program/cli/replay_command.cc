#include "drivers/study/replay/replay.h"
#include "drivers/study/report/outputs.h"

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "drivers/program/cli/commands.h"
#include "drivers/program/cli/progress_bar.h"
#include "drivers/program/view/live_view.h"
#include "drivers/study/report/stats_json.h"
#include "pipeline/config/config.h"

namespace epiline {

namespace {

struct ReplayArguments {
  ReplayOptions replay;
  std::string out = "epiline-out", visual_factor;
  std::vector<std::string> faults;
  double deadline_ms = 0, speed = 1;
  bool quiet = false, realtime = false;
  std::string view;
};

void print_realtime(const FlightRecord& r, const Timing& t) {
  const RealtimeReport& report = r.realtime->report;
  fmt::print("latency   {:.2f} ms median, {:.2f} ms 99 %, {:.2f} ms at most, from image stamp to odometry\n",
             t.latency.median, t.latency.p99, t.latency.max);
  fmt::print("threads   {} images in, {} overtaken, {} missed by the camera; page faults {}, heap calls {}, locks {}\n",
             report.frames_in, report.frames_overtaken, r.skipped.at("missed_by_camera"), r.page_faults,
             r.heap_calls ? std::to_string(*r.heap_calls) : "not counted",
             r.lock_calls ? std::to_string(*r.lock_calls) : "not counted");
  if (const auto& recorder = r.realtime->recorder) {
    for (const std::string& folder : recorder->written) fmt::print("record    {}\n", folder);
    for (const std::string& line : recorder->failed) fmt::print("note      record failed: {}\n", line);
  }
  fmt::print("imu rate  {} predictions, {:.2f} ms 99 %, {:.2f} ms at most, from reading to odometry\n",
             report.predicted, 1e-6 * static_cast<double>(report.prediction_latency.quantile_ns(0.99)),
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
  fmt::print("solve     {:.3f} ms mean, {:.3f} ms 99 %\n", t.solve.mean, t.solve.p99);
  fmt::print("estimate  {:.3f} ms mean, {:.3f} ms 99 %\n", t.estimate.mean, t.estimate.p99);
  if (r.realtime) print_realtime(r, t);
  if (const auto& f = r.load.frames; f[1] + f[2] + f[3] > 0)
    fmt::print("load      {} images in full, {} with fewer features, {} with fewer iterations, {} predicted only\n",
               f[0], f[1], f[2], f[3] - r.load.let_through);
  fmt::print("report    {}/report.html\n", out);
}

std::string refusals(const EstimatorStats& stats) {
  std::string s;
  for (int i = 0; i < static_cast<int>(StartRefusal::kCount); ++i) {
    if (stats.start_refused[i] == 0) continue;
    s += fmt::format("{}{} {}", s.empty() ? "" : ", ", to_string(static_cast<StartRefusal>(i)), stats.start_refused[i]);
  }
  return s.empty() ? "no start tried" : "starts refused: " + s;
}

std::string fault_help() {
  std::string s = "what goes wrong with the sensors, NAME@SECONDS[:DURATION] after the first image:";
  for (const FaultInfo& info : all_faults()) s += fmt::format("\n{}: {}", info.name, info.what);
  return s;
}

int replay_command(ReplayArguments& options) {
  for (const std::string& text : options.faults) {
    const auto fault = fault_from(text);
    if (!fault) return report(fault.error());
    options.replay.faults.push_back(*fault);
  }
  options.replay.visual_factor = visual_factor_from(options.visual_factor);
  if (options.deadline_ms > 0) options.replay.deadline_ms = options.deadline_ms;
  if (options.realtime) options.replay.realtime_speed = options.speed;
  if (std::filesystem::exists(options.out) && !std::filesystem::is_directory(options.out)) {
    return report({ErrorKind::kUsage, options.out, 0, "is no folder", "a folder for the results"});
  }
  const auto view = open_view(options.view);
  if (!view) return report(view.error());
  options.replay.view = view->get();
  ProgressBar bar(options.quiet);
  const auto result = replay(options.replay, [&](std::size_t done, std::size_t all) { bar(done, all); });
  if (!result) return report(result.error());
  const FlightRecord& record = result->record;
  const auto errors = write_outputs(record, options.out);
  if (!errors) return report(errors.error());
  if (!options.quiet) {
    for (const std::string& note : result->notes) fmt::print("note      {}\n", note);
    print_summary(record, *errors, options.out);
  }
  if (!start_seconds(record)) {
    return report({ErrorKind::kRun, record.dataset_path, 0,
                   fmt::format("never initialised in {} images ({})", record.images.size(), refusals(record.estimator)),
                   "a stretch of standstill, or of motion with texture in view"});
  }
  return kExitDone;
}

}  // namespace

void add_replay(CLI::App& app, int& exit_code) {
  const auto o = std::make_shared<ReplayArguments>();
  CLI::App* command = app.add_subcommand("replay", "Odometry from a recorded flight: trajectory, figures, report");
  command->add_option("DATASET", o->replay.dataset, "ASL folder (mav0/{cam0,imu0,...}) or ROS 1 bag")->required();
  command->add_option("--out", o->out, "folder for the results")->capture_default_str();
  command->group(kAnalyse);
  add_settings(*command, o->replay.config_file, o->replay.set, "settings (TOML); see epiline config");
  command->add_option("--visual-factor", o->visual_factor, "residual of a track")
      ->check(CLI::IsMember(kVisualFactorNames));
  command->add_option("--camera", o->replay.camera, "which camera")
      ->check(CLI::IsMember({"cam0", "cam1"}))
      ->capture_default_str();
  command->add_option("--image-topic", o->replay.topics.image, "of a bag; else the first with images");
  command->add_option("--imu-topic", o->replay.topics.imu, "of a bag; else the first with IMU samples");
  command->add_option("--truth-topic", o->replay.topics.truth, "of a bag; else the first with poses, if any");
  command->add_option("--start", o->replay.start_s, "seconds of images left out at the beginning")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--duration", o->replay.duration_s, "ends after that many seconds")->check(CLI::PositiveNumber);
  command
      ->add_option("--deadline-ms", o->deadline_ms,
                   "time for the solve of one image; the result then depends on the computer")
      ->check(CLI::PositiveNumber);
  CLI::Option* const realtime =
      command->add_flag("--realtime", o->realtime, "in threads, each sample at its time, as a live run does it");
  command->add_option("--speed", o->speed, "of the recording's clock in a real-time run")
      ->check(CLI::Range(0.01, 1000.0))
      ->needs(realtime);
  command->add_option("--view", o->view, "[ADDRESS:]PORT: a page that shows the flight while it goes on; 0: any port")
      ->type_name("[ADDRESS:]PORT")
      ->needs(realtime);
  CLI::Option* const record =
      command->add_option("--record", o->replay.record_folder, "flight recorder: records go into this folder")
          ->needs(realtime);
  command->add_flag("--record-images", o->replay.record_images, "images are recorded too")->needs(record);
  command
      ->add_option("--loop", o->replay.loop_s, "fly it again and again, each round a new start, for that many seconds")
      ->check(CLI::PositiveNumber);
  command->add_flag("--imu-rate", o->replay.imu_rate, "write odometry_imu_rate.tum: the odometry at every IMU reading")
      ->needs(realtime);
  command->add_option("--shift-images", o->replay.shift_images_ms, "ms added to the images' stamps, to test with");
  command->add_option("--fault", o->faults, fault_help());
  command->add_flag("--quiet", o->quiet, "no summary, no progress");
  command->callback([o, &exit_code] { exit_code = replay_command(*o); });
}

}  // namespace epiline
