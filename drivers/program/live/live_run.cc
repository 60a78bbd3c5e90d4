#include "drivers/program/live/live_run.h"

#include <fmt/format.h>

#include <cmath>
#include <csignal>
#include <memory>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "drivers/program/live/live_log.h"
#include "drivers/program/live/opener.h"
#include "drivers/program/live/receivers.h"
#include "drivers/program/live/service.h"
#include "drivers/program/view/live_view.h"
#include "drivers/study/replay/recorded_run.h"
#include "drivers/study/report/page.h"
#include "pipeline/text/suspicion_text.h"
#include "pipeline/text/table.h"
#include "platform/linux/signals.h"

namespace epiline {

namespace {

constexpr Span kRound = Span::from_milliseconds(50);  // between looks at a flight

/// Tells a device how fast the body turns.
class Turns final : public FlightObserver {
 public:
  explicit Turns(const std::function<void(double)>& tell) : tell_(tell) {}
  void imu(const ImuSample& sample) noexcept override {
    const auto& w = sample.angular_velocity_rad_s;
    if (tell_) tell_(std::hypot(w[0], w[1], w[2]));
  }

 private:
  const std::function<void(double)>& tell_;
};

/// Closes what was opened, whichever way the flight ends.
class OpenDevices {
 public:
  OpenDevices(LiveDevices& devices, Receivers& receivers, bool waits)
      : devices_(devices), receivers_(receivers), waits_(waits) {}
  ~OpenDevices() { close(); }
  OpenDevices(const OpenDevices&) = delete;
  OpenDevices& operator=(const OpenDevices&) = delete;

  void close() noexcept {
    if (std::exchange(closed_, true)) return;
    devices_.camera->close();
    devices_.imu->close();
    if (devices_.wheel) devices_.wheel->close();
    if (devices_.height) devices_.height->close();
    receivers_.close();
  }
  /// In the order of opening. The receivers first, for an IMU or heights may come over one of their lines; none is
  /// waited for. The camera last: its buffers fill from then on.
  std::vector<Opener::Part> parts() const {
    const auto part_of = [](const char* name, auto* source) {
      return Opener::Part{name, [source] { return source->open(); }, [source] { source->close(); }};
    };
    std::vector<Opener::Part> parts{{"receivers", [this] { return receivers_.open_each(waits_); }, [] {}},
                                    part_of("IMU", devices_.imu.get())};
    parts.back().give_up = [imu = devices_.imu.get()] { imu->give_up(); };
    if (devices_.wheel) parts.push_back(part_of("wheel speed", devices_.wheel.get()));
    if (devices_.height) parts.push_back(part_of("height", devices_.height.get()));
    parts.push_back(part_of("camera", devices_.camera.get()));
    return parts;
  }

 private:
  LiveDevices& devices_;
  Receivers& receivers_;
  bool waits_, closed_ = false;
};

FlightRecord begin_record(const LiveSettings& settings) {
  FlightRecord record;
  record.dataset_path = settings.source;
  record.visual_factor = settings.config.estimator.visual_factor.name;
  record.keyframes = settings.config.estimator.keyframes;
  record.max_features = settings.config.tracker.max_features;
  if (settings.config.deadline_ms > 0) record.deadline_ms = settings.config.deadline_ms;
  return record;
}

std::array<std::optional<CameraParameters>, kMostOthers> other_lenses(const LiveSettings& settings) {
  std::array<std::optional<CameraParameters>, kMostOthers> lenses;
  for (std::size_t i = 0; i < kMostOthers; ++i)
    if (settings.others[i]) lenses[i] = settings.others[i]->parameters;
  return lenses;
}

RealtimeSettings pipeline_settings(const LiveSettings& settings, const LiveDevices& devices) {
  const Config& c = settings.config;
  RealtimeSettings s{settings.camera, c.tracker, c.estimator, settings.imu_correction, c.deadline_ms,
                     c.realtime,      true,      {},          devices.images_to_log};
  s.others = other_lenses(settings);
  return s;
}

std::string status_line(const LiveState& state) {
  const std::string lost = state.lost_outputs.empty() ? "" : "; lost: " + state.lost_outputs;
  if (!state.has_pose) return fmt::format("initialising: {} images, {} readings{}", state.images, state.readings, lost);
  const Odometry& o = state.odometry;
  const char* const health = kHealthStateNames[static_cast<std::size_t>(o.health.state)];
  return fmt::format("{}, quality {}{}", health, o.health.quality, lost);
}

/// Reports a running flight to the service manager.
class ServiceTalk {
 public:
  void ready() { manager_.ready(); }
  void waits(const std::string& waiting_for, Span since_start) {
    if (!manager_.is_listening() || (told_waiting_ && since_start - *told_waiting_ < kStatus)) return;
    told_waiting_ = since_start;
    manager_.starting();
    if (!waiting_for.empty()) manager_.status("waiting for " + waiting_for);
  }
  void stopping() { manager_.stopping(); }

  void round(const LiveState& state, const RealtimePipeline::Progress& progress, std::uint64_t log_passes) {
    if (!manager_.is_listening()) return;
    if (state.since_start - told_status_ >= kStatus) {
      manager_.status(status_line(state));
      told_status_ = state.since_start;
    }
    // a third of the time it allows, so that one late round is no reason to be ended
    if (state.since_start - told_alive_ > Span{manager_.watchdog().ns / 3} &&
        liveness_.moved({progress.frames_taken, progress.frames_out, progress.published, log_passes})) {
      manager_.alive();
      told_alive_ = state.since_start;
    }
  }

 private:
  ServiceManager manager_;
  Liveness liveness_;
  static constexpr Span kStatus = Span::from_seconds(1);  // between two statuses, which are messages on the bus
  Span told_status_, told_alive_;                         ///< when, since the start
  std::optional<Span> told_waiting_;                      ///< since the begin of opening
};

void watch_with(LiveView& view, const LiveSettings& settings, RealtimePorts& ports) {
  const ViewSubject subject{settings.source, program_text(program_info()), settings.config.estimator.extrinsics.R_BC,
                            true};
  if (!view.start(subject))
    throw std::system_error(std::make_error_code(std::errc::resource_unavailable_try_again), "no thread left");
  ports.observers.push_back(&view.observer());
}

/// Null if none is configured.
std::unique_ptr<FlightRecorder> add_recorder(const LiveSettings& settings, RealtimePorts& ports) {
  if (settings.config.recorder.folder.empty()) return nullptr;
  constexpr double kUsualRate_hz = 30;
  const double rate_hz = settings.config.devices.camera.rate_hz;
  auto recorder = std::make_unique<FlightRecorder>(
      settings.config.recorder,
      recorded_run(settings.camera, other_lenses(settings), rate_hz > 0 ? rate_hz : kUsualRate_hz,
                   settings.imu_correction, settings.config));
  ports.observers.push_back(recorder.get());
  ports.event_rings.push_back(&recorder->events());
  return recorder;
}

LiveState state_of(const RealtimePipeline::Progress& progress, Receivers& receivers, Span since_start) {
  LiveState state{false, {}, progress.frames_out,       progress.imu_in,      since_start,
                  {},    {}, receivers.names_of_lost(), receivers.refusals(), receivers.notes()};
  if (const Odometry* const newest = receivers.newest()) {
    state.has_pose = true;
    state.odometry = *newest;
  }
  return state;
}

void complete(FlightRecord& record, const RealtimePipeline& pipeline, double speed, const LiveDevices& devices) {
  take_report(pipeline, speed, record);
  record.images_read = record.dataset_images = record.realtime->report.frames_in;
  record.dataset_imu_samples = record.imu_read;
  for (const LiveOutput& output : devices.outputs) record.realtime->outputs.push_back(output.record());
  for (const auto& device : devices.records) record.realtime->devices.push_back(device());
}

/// The folder of the files that grow during the flight: the user's, else a new one beside the flight recorder's
/// records.
std::filesystem::path log_folder(const LiveOptions& options, const RecorderConfig& recorder) {
  if (!options.out.empty() || recorder.folder.empty()) return options.out;
  return make_flight_folder(recorder.folder, static_cast<std::size_t>(recorder.keep));
}

/// Opens all sources, or says which one was missing at the end. Receivers are not waited for.
Status open_all(const OpenDevices& devices, const Receivers& receivers, const EndSignals& signals,
                const LiveOptions& options, ServiceTalk& service, const std::function<bool(const LiveState&)>& watch) {
  Opener opener(devices.parts(), options.waits_for_devices);
  const std::int64_t start_ns = monotonic_ns();
  constexpr Span kLook = Span::from_milliseconds(20);
  for (bool goes_on = true; goes_on && !opener.has_ended();) {
    const int signal = signals.wait(kLook);
    LiveState state;
    state.since_start = Span{monotonic_ns() - start_ns};
    state.waiting_for = opener.waiting_for();
    if (const std::string more = receivers.waiting_for(); !state.waiting_for.empty() && !more.empty())
      state.waiting_for += "; " + more;
    service.waits(state.waiting_for, state.since_start);
    goes_on = !signals.ends(signal) && state.since_start.seconds() < options.duration_s &&
              (state.waiting_for.empty() || watch(state));
    if (!goes_on) {
      opener.give_up();
      if (opener.result()) return Error{ErrorKind::kRun, "", 0, "ended before all devices were open", ""};
    }
  }
  return opener.result();
}

/// fly(), with what the system's lack of threads and settings that do not go together throw.
Result<FlightRecord> fly_or_throw(const LiveSettings& settings, LiveDevices& devices, const LiveOptions& options,
                                  const std::function<bool(const LiveState&)>& watch) {
  const EndSignals signals;  // before any thread begins
  Receivers receivers(devices.outputs);
  LiveLog log(log_folder(options, settings.config.recorder), options.keeps_images);
  Turns turns(devices.turns);
  RealtimePorts ports{devices.camera.get(), devices.imu.get(),   &receivers, {&log, &turns}, {},
                      devices.wheel.get(),  devices.height.get()};
  for (const LiveOutput& output : devices.outputs)
    if (output.observer != nullptr) ports.observers.push_back(output.observer);
  if (options.view != nullptr) watch_with(*options.view, settings, ports);
  const std::unique_ptr<FlightRecorder> recorder = add_recorder(settings, ports);
  OpenDevices open_devices(devices, receivers, options.waits_for_devices);
  RealtimePipeline pipeline(pipeline_settings(settings, devices), ports);
  ServiceTalk service;
  if (const Status s = open_all(open_devices, receivers, signals, options, service, watch); !s) return s.error();

  const std::int64_t start_ns = monotonic_ns();
  const auto since_start = [&] { return Span{monotonic_ns() - start_ns}; };
  const Pace pace = options.pace.value_or(Pace{HostStamp{start_ns}, start_ns, 1});
  pipeline.arm(pace);
  service.ready();
  FlightRecord record = begin_record(settings);
  std::uint64_t told = 0;  // events looked at
  for (bool goes_on = true; goes_on && !pipeline.finished();) {
    const int signal = signals.wait(kRound);
    if (signal == SIGUSR1 && recorder) recorder->request();
    log.drain(record);
    const RealtimePipeline::Progress progress = pipeline.progress();
    LiveState state = state_of(progress, receivers, since_start());
    for (; told < record.events_lost + record.events.size(); ++told) {
      const Event& event = record.events[told - record.events_lost];
      if (event.id == EventId::kNumberWrong) state.numbers_wrong.push_back(text_of(event));
    }
    service.round(state, progress, log.passes());
    goes_on = watch(state) && !signals.ends(signal) && state.since_start.seconds() < options.duration_s;
  }
  service.stopping();
  pipeline.stop();
  pipeline.join();
  open_devices.close();
  if (options.view != nullptr) options.view->finish();
  log.drain(record);
  if (const Status s = log.close(record); !s) record.unwritten = s.error();
  record.dataset_duration_s = since_start().seconds();
  complete(record, pipeline, pace.speed, devices);
  if (recorder) finish(*recorder, record);
  return record;
}

}  // namespace

Result<FlightRecord> fly(const LiveSettings& settings, LiveDevices& devices, const LiveOptions& options,
                         const std::function<bool(const LiveState&)>& watch) {
  if (!options.out.empty()) {
    if (const Status s = make_folder(options.out); !s) return s.error();
  }
  try {
    auto record = fly_or_throw(settings, devices, options, watch);
    if (record) record->peak_rss_mib = peak_rss_mib();
    return record;
  } catch (const std::system_error& e) {
    return Error{ErrorKind::kRun, settings.source, 0, e.what(), "free threads and memory (ulimit -u, ulimit -l)"};
  } catch (const std::invalid_argument& e) {
    return Error{ErrorKind::kUsage, settings.source, 0, e.what(), "settings that are consistent with each other"};
  }
}

}  // namespace epiline
