#include "drivers/live/live_run.h"

#include <fmt/format.h>

#include <cmath>
#include <csignal>
#include <system_error>
#include <utility>

#include "drivers/live/live_log.h"
#include "drivers/live/service.h"
#include "drivers/replay/flight_plan.h"
#include "drivers/replay/recorded_run.h"
#include "drivers/view/live_view.h"
#include "pipeline/report/page.h"
#include "pipeline/text/table.h"
#include "platform/concurrency/latest_value.h"
#include "platform/linux/signals.h"

namespace epiline {

namespace {

constexpr Span kRound = Span::from_milliseconds(50);  // between looks at a flight

/// Hands the odometry to all receivers, and keeps the newest for whoever watches.
class Receivers final : public OdometrySink {
 public:
  explicit Receivers(const std::vector<LiveOutput>& outputs) : outputs_(outputs) {}

  Status open() override {
    for (const LiveOutput& output : outputs_) {
      if (const Status s = output.sink->open(); !s) return s;
    }
    return Done{};
  }
  void close() noexcept override {
    for (const LiveOutput& output : outputs_) output.sink->close();
  }
  bool publish(const Odometry& odometry) noexcept override {
    newest_.write(odometry);
    bool all = true;
    for (const LiveOutput& output : outputs_) all &= output.sink->publish(odometry);
    return all;
  }
  bool publish_image(const Odometry& odometry) noexcept override {
    bool all = true;
    for (const LiveOutput& output : outputs_) all &= output.sink->publish_image(odometry);
    return all;
  }
  const Odometry* newest() noexcept { return newest_.read(); }

 private:
  const std::vector<LiveOutput>& outputs_;
  LatestValue<Odometry> newest_;
};

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
  OpenDevices(LiveDevices& devices, Receivers& receivers) : devices_(devices), receivers_(receivers) {}
  ~OpenDevices() { close(); }
  OpenDevices(const OpenDevices&) = delete;
  OpenDevices& operator=(const OpenDevices&) = delete;

  void close() noexcept {
    if (std::exchange(closed_, true)) return;
    devices_.camera->close();
    devices_.imu->close();
    if (devices_.wheel) devices_.wheel->close();
    receivers_.close();
  }
  /// The camera last: its buffers fill from then on.
  Status open() {
    if (const Status s = receivers_.open(); !s) return s;
    if (const Status s = devices_.imu->open(); !s) return s;
    if (devices_.wheel) {
      if (const Status s = devices_.wheel->open(); !s) return s;
    }
    return devices_.camera->open();
  }

 private:
  LiveDevices& devices_;
  Receivers& receivers_;
  bool closed_ = false;
};

FlightRecord begin_record(const LiveSettings& settings) {
  FlightRecord record;
  record.dataset_path = settings.source;
  record.visual_factor = to_string(settings.config.estimator.visual_factor);
  record.keyframes = settings.config.estimator.keyframes;
  record.max_features = settings.config.tracker.max_features;
  if (settings.config.deadline_ms > 0) record.deadline_ms = settings.config.deadline_ms;
  return record;
}

RealtimeSettings pipeline_settings(const LiveSettings& settings, const LiveDevices& devices) {
  const Config& c = settings.config;
  return {settings.camera, c.tracker, c.estimator, c.deadline_ms, c.realtime, true, {}, devices.images_to_log};
}

std::string status_line(const LiveState& state) {
  if (!state.has_pose) return fmt::format("initialising: {} images, {} readings", state.images, state.readings);
  const Odometry& o = state.odometry;
  return fmt::format("{}, quality {}", kHealthStateNames[static_cast<std::size_t>(o.health.state)], o.health.quality);
}

}  // namespace

Result<FlightRecord> fly(const LiveSettings& settings, LiveDevices& devices, const LiveOptions& options,
                         const std::function<bool(const LiveState&)>& watch) {
  if (!options.out.empty()) {
    if (const Status s = make_folder(options.out); !s) return s.error();
  }
  FlightRecord record = begin_record(settings);
  Receivers receivers(devices.outputs);
  try {
    const SignalWait signals({SIGINT, SIGTERM, SIGUSR1});  // before any thread begins
    ServiceManager service;
    LiveLog log(options.out);
    Turns turns(devices.turns);
    RealtimePorts ports{devices.camera.get(), devices.imu.get(), &receivers, {&log, &turns}, {}, devices.wheel.get()};
    if (options.view != nullptr) {
      const ViewSubject subject{settings.source, program_text(program_info()),
                                settings.config.estimator.extrinsics.R_BC, true};
      if (!options.view->start(subject))
        throw std::system_error(std::make_error_code(std::errc::resource_unavailable_try_again), "no thread left");
      ports.observers.push_back(&options.view->observer());
    }
    std::optional<FlightRecorder> recorder;
    if (!settings.config.recorder.folder.empty()) {
      constexpr double kUsualRate_hz = 30;
      const double rate_hz = settings.config.devices.camera.rate_hz;
      recorder.emplace(settings.config.recorder,
                       recorded_run(settings.camera, rate_hz > 0 ? rate_hz : kUsualRate_hz, settings.config));
      ports.observers.push_back(&*recorder);
      ports.event_rings.push_back(&recorder->events());
    }
    OpenDevices open_devices(devices, receivers);
    RealtimePipeline pipeline(pipeline_settings(settings, devices), ports);
    if (const Status s = open_devices.open(); !s) return s.error();
    const std::int64_t start_ns = monotonic_ns();
    const Pace pace = options.pace.value_or(Pace{HostStamp{start_ns}, start_ns, 1});
    pipeline.arm(pace);
    service.ready();

    Liveness liveness;
    std::int64_t told_alive_ns = start_ns;
    for (bool goes_on = true; goes_on && !pipeline.finished();) {
      const int signal = signals.wait(kRound);
      if (signal == SIGUSR1 && recorder) recorder->request();
      log.drain(record);
      const std::int64_t now_ns = monotonic_ns();
      const RealtimePipeline::Progress progress = pipeline.progress();
      LiveState state{false, {}, progress.frames_out, progress.imu_in, Span{now_ns - start_ns}};
      if (const Odometry* const newest = receivers.newest()) {
        state.has_pose = true;
        state.odometry = *newest;
      }
      if (service.is_listening()) {
        service.status(status_line(state));
        // a third of the time it allows, so that one late round is no reason to be ended
        if (now_ns - told_alive_ns > service.watchdog().ns / 3 &&
            liveness.moved({progress.frames_taken, progress.frames_out, progress.published, log.passes()})) {
          service.alive();
          told_alive_ns = now_ns;
        }
      }
      goes_on =
          watch(state) && signal != SIGINT && signal != SIGTERM && state.since_start.seconds() < options.duration_s;
    }
    service.stopping();
    pipeline.stop();
    pipeline.join();
    open_devices.close();
    if (options.view != nullptr) options.view->finish();
    log.drain(record);
    if (const Status s = log.close(record); !s) return s.error();
    take_report(pipeline, pace.speed, record);
    record.images_read = record.realtime->report.frames_in;
    record.dataset_duration_s = Span{monotonic_ns() - start_ns}.seconds();
    record.dataset_images = record.realtime->report.frames_in;
    record.dataset_imu_samples = record.imu_read;
    if (recorder) finish(*recorder, record);
    for (const LiveOutput& output : devices.outputs) record.realtime->outputs.push_back(output.record());
    for (const auto& device : devices.records) record.realtime->devices.push_back(device());
  } catch (const std::system_error& e) {
    return Error{ErrorKind::kRun, settings.source, 0, e.what(), "a system that can start its threads"};
  } catch (const std::invalid_argument& e) {
    return Error{ErrorKind::kUsage, settings.source, 0, e.what(), "settings that go together"};
  }
  record.peak_rss_mib = peak_rss_mib();
  return record;
}

}  // namespace epiline
