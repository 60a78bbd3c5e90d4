#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <string>
#include <vector>

#include "drivers/program/cli/commands.h"
#include "drivers/program/cli/say.h"
#include "drivers/program/live/live_run.h"
#include "drivers/program/view/live_view.h"
#include "drivers/study/replay/replay.h"
#include "drivers/study/report/outputs.h"
#include "drivers/study/report/stats_json.h"
#include "platform/linux/end_request.h"

namespace epiline {

namespace {

struct RunArguments {
  LiveOptions live;
  std::filesystem::path config;
  std::vector<std::string> set;
  std::string view, record_folder;
  bool record_images = false, dds = false, quiet = false;
};

std::string reasons_text(std::uint32_t reasons) {
  std::string s;
  for (int i = 0; i < kHealthReasons; ++i) {
    if ((reasons >> i & 1u) != 0) s += fmt::format("{}{}", s.empty() ? "" : ", ", kHealthReasonNames[i]);
  }
  return s;
}

/// Prints a line when the health state changes, or a receiver is lost or found again. On a terminal, another line is
/// overwritten twice a second with position and velocity.
class StateLines {
 public:
  explicit StateLines(bool quiet) : quiet_(quiet), terminal_(!quiet && isatty(STDERR_FILENO) == 1) {}
  ~StateLines() {
    if (shown_) say(stderr, "\n");
  }
  StateLines(const StateLines&) = delete;
  StateLines& operator=(const StateLines&) = delete;

  void operator()(const LiveState& state) {
    if (quiet_) return;
    if (state.waiting_for != waiting_for_) {
      clear();
      waiting_for_ = state.waiting_for;
      if (!waiting_for_.empty()) say("{:9.2f} s  waiting for {}\n", state.since_start.seconds(), waiting_for_);
    }
    if (!state.waiting_for.empty()) return;
    for (const std::string& text : state.numbers_wrong) {
      clear();
      say("{:9.2f} s  number wrong: {}\n", state.since_start.seconds(), text);
    }
    if (state.refusals != refusals_) {
      clear();
      refusals_ = state.refusals;
      if (!refusals_.empty()) say("{:9.2f} s  {}\n", state.since_start.seconds(), refusals_);
    }
    for (const std::string& note : state.notes) {
      if (std::find(notes_.begin(), notes_.end(), note) != notes_.end()) continue;
      clear();
      say("{:9.2f} s  {}\n", state.since_start.seconds(), note);
    }
    notes_ = state.notes;
    const HealthState now = state.has_pose ? state.odometry.health.state : HealthState::kInitialising;
    if (!known_ || now != state_ || state.lost_outputs != lost_) {
      clear();
      const std::string why = state.has_pose ? reasons_text(state.odometry.health.reasons) : "";
      say("{:9.2f} s  {}{}{}{}{}\n", state.since_start.seconds(), kHealthStateNames[static_cast<std::size_t>(now)],
          why.empty() ? "" : ": ", why, state.lost_outputs.empty() ? "" : "; lost: ", state.lost_outputs);
      known_ = true;
      state_ = now;
      lost_ = state.lost_outputs;
    }
    if (terminal_ && ++rounds_ % 10 == 0) show(state);
  }

 private:
  void clear() {
    if (shown_) say(stderr, "\r\x1b[K");
    shown_ = false;
  }
  void show(const LiveState& state) {
    clear();
    const Odometry& o = state.odometry;
    if (state.has_pose) {
      say(stderr, "{:9.2f} s  quality {:3}  p {:7.2f} {:7.2f} {:7.2f} m  v {:6.2f} {:6.2f} {:6.2f} m/s",
          state.since_start.seconds(), o.health.quality, o.p_WB_m[0], o.p_WB_m[1], o.p_WB_m[2], o.v_WB_m_s[0],
          o.v_WB_m_s[1], o.v_WB_m_s[2]);
    } else {
      say(stderr, "{:9.2f} s  {} images, {} IMU samples", state.since_start.seconds(), state.images, state.readings);
    }
    shown_ = true;
  }

  bool quiet_, terminal_, known_ = false, shown_ = false;
  HealthState state_ = HealthState::kInitialising;
  std::string lost_, refusals_, waiting_for_;
  std::vector<std::string> notes_;
  unsigned rounds_ = 0;
};

void print_summary(const FlightRecord& r) {
  const RealtimeReport& report = r.realtime->report;
  say("images    {} in, {} estimated, {} overtaken\n", report.frames_in, report.frames_out, report.frames_overtaken);
  say("samples   {} IMU samples in, {} predictions published\n", report.imu_in, report.predicted);
  for (const OutputRecord& o : r.realtime->outputs) {
    const auto ms = [](std::int64_t ns) { return 1e-6 * static_cast<double>(ns); };
    say("output    {}: {} sent, {} not sent, reopened {} times", o.name, o.sent, o.not_sent, o.reopened);
    if (o.latency.count() > 0) {
      say("; {:.2f} ms median, {:.2f} ms 99 %, {:.2f} ms max, from image timestamp to last byte",
          ms(o.latency.quantile_ns(0.5)), ms(o.latency.quantile_ns(0.99)), ms(o.latency.most_ns()));
    }
    say("\n");
  }
  for (const std::string& line : r.realtime->shortfalls) say("note      {}\n", line);
}

/// Why there never was a pose: the first thing that was missing.
Error no_pose(const LiveState& last) {
  const auto error = [&](const char* found, const char* expected) {
    return Error{ErrorKind::kRun, "", 0, fmt::format("no pose in {:.1f} s: {}", last.since_start.seconds(), found),
                 expected};
  };
  if (last.readings == 0) return error("no IMU samples arrived", "an IMU that delivers (epiline check)");
  if (last.images == 0)
    return error("no image was estimated",
                 "a camera that delivers, with the clock of its images known (epiline check)");
  return error("the estimator did not start", "texture in view and light, at rest or in motion (epiline check)");
}

int run_command(RunArguments& options) {
  const auto config = find_config(options.config);
  if (!config) return report(config.error());
  auto settings = read_live_settings(*config, options.set);
  if (!settings) return report(settings.error());
  if (!options.record_folder.empty()) settings->config.recorder.folder = options.record_folder;
  settings->config.recorder.images |= options.record_images;
  settings->config.devices.dds.publish |= options.dds;
  const auto folder = claim(options.live.out, kFlightFiles, Foreign::kKeep);
  if (!folder) return report(folder.error());
  if (*folder && !options.quiet)
    for (const std::string& note : (*folder)->notes()) fmt::print("note      {}\n", note);
  const auto view = open_view(options.view);
  if (!view) return report(view.error());
  options.live.view = view->get();
  options.live.keeps_images = !options.live.out.empty();
  auto devices = make_devices(*settings);
  if (!devices) return report(devices.error());
  LiveState last;
  const auto record = [&] {
    StateLines lines(options.quiet);
    return fly(*settings, *devices, options.live, [&](const LiveState& state) {
      lines(state);
      if (*view != nullptr) (*view)->set_notes_of_receivers(state.notes);
      last = state;
      return true;
    });
  }();
  if (!record) return report(record.error());
  const EndRequest writing;  // no signal takes away what the flight has left
  std::optional<Error> unwritten = record->unwritten;
  if (!options.live.out.empty()) {
    const auto errors = write_report(*record, options.live.out);
    if (!errors && !unwritten) unwritten = errors.error();
  }
  if (!options.quiet) print_summary(*record);
  if (unwritten) return report(*unwritten);
  // a service that was stopped has done what it was asked; its manager would take another code for a failure to stop
  return last.has_pose || std::getenv("NOTIFY_SOCKET") != nullptr ? kExitDone : report(no_pose(last));
}

}  // namespace

void add_run(CLI::App& app, int& exit_code) {
  const auto [command, o] = add_command(
      app, exit_code, kFly, "run",
      "Estimate odometry from a live camera and IMU, and send it to flight controllers and buses", run_command);
  o->live.waits_for_devices = true;
  add_settings(*command, o->config, o->set,
               "configuration file (TOML) with devices, calibration and settings; default: /etc/epiline/epiline.toml, "
               "else ./epiline.toml");
  command->add_option("--out", o->live.out,
                      "write trajectory, events, figures and report into this folder; files there that are no earlier "
                      "results get a number");
  command->add_option("--duration", o->live.duration_s, "end after this many seconds")->check(CLI::PositiveNumber);
  command->add_option("--view", o->view, "serve a page that shows the flight; port 0 takes any free port")
      ->type_name("[ADDRESS:]PORT");
  command->add_flag("--dds", o->dds, "publish odometry, transform and diagnostics for nodes of ROS 2");
  CLI::Option* const record =
      command->add_option("--record", o->record_folder, "flight recorder: write records into this folder");
  command->add_flag("--record-images", o->record_images, "record images too")->needs(record);
  command->add_flag_callback(
      "--no-wait", [o = o] { o->live.waits_for_devices = false; },
      "end with an error if a device is not there yet, instead of waiting for it");
  command->add_flag("--quiet", o->quiet, "print errors only");
}

}  // namespace epiline
