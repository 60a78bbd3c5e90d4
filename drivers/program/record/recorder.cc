#include "drivers/program/record/recorder.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <system_error>
#include <utility>

#include "drivers/program/live/opener.h"
#include "drivers/program/live/service.h"
#include "drivers/program/record/record_writer.h"
#include "drivers/program/record/recording_files.h"
#include "drivers/program/record/sample_intake.h"
#include "platform/linux/signals.h"
#include "platform/linux/step_thread.h"
#include "platform/time/monotonic.h"

namespace epiline {

namespace {

constexpr Span kRecordRound = Span::from_milliseconds(50);  // between looks at a recording
constexpr Span kWriteAtEnd = Span::from_milliseconds(100);  // for images that wait when it ends
constexpr double kStart_s = 3;                              // sensors give something by then
constexpr double kAhead_s = 3;  // at the current rate, beyond what is kept free: a disk is not asked all the time

/// Closes what was opened, whichever way the recording ends.
class OpenSensors {
 public:
  explicit OpenSensors(LiveDevices& devices) : devices_(devices) {}
  ~OpenSensors() {
    devices_.camera->close();
    devices_.imu->close();
    for (const LiveOutput& link : devices_.outputs) link.sink->close();
  }
  OpenSensors(const OpenSensors&) = delete;
  OpenSensors& operator=(const OpenSensors&) = delete;

  /// The camera last: its buffers fill from then on. A signal ends the wait for a device.
  Status open(const EndSignals& signals) {
    std::vector<Opener::Part> parts;
    for (const LiveOutput& link : devices_.outputs)
      parts.push_back({link.name, [s = link.sink.get()] { return s->open(); }, [] {}});
    ImuSource* const imu = devices_.imu.get();
    parts.push_back({"IMU", [imu] { return imu->open(); }, [] {}, [imu] { imu->give_up(); }});
    parts.push_back({"camera", [c = devices_.camera.get()] { return c->open(); }, [] {}});
    Opener opener(std::move(parts), false);
    while (!opener.has_ended()) {
      if (!signals.ends(signals.wait(Span::from_milliseconds(20)))) continue;
      const std::string missing = opener.waiting_for();
      opener.give_up();
      return Error{ErrorKind::kRun, "", 0,
                   "ended before all devices were open" + (missing.empty() ? "" : ": " + missing), ""};
    }
    return opener.result();
  }

 private:
  LiveDevices& devices_;
};

/// Rates over the last second.
class RateWatch {
 public:
  void step(RecordState& state) {
    const double passed = state.seconds - before_.seconds;
    const auto rate = [&](std::uint64_t now, std::uint64_t before) {
      return static_cast<double>(now - before) / passed;
    };
    if (passed >= 1) {
      state.image_rate_hz = rate(state.counts.images, before_.counts.images);
      state.reading_rate_hz = rate(state.counts.readings, before_.counts.readings);
      before_ = state;
    }
  }

 private:
  RecordState before_;
};

/// How long the disk lasts. The rate is that of all bytes since the first ones.
class SpaceWatch {
 public:
  explicit SpaceWatch(const RecordOptions& options) : options_(options) {}

  /// False: only the reserve of the disk is left.
  bool step(RecordState& state) {
    if (begin_s_ == 0 && state.bytes > 0) {
      begin_s_ = state.seconds;
      begin_bytes_ = state.bytes;
    }
    if (begin_s_ > 0 && state.seconds - begin_s_ >= 1)
      state.bytes_per_s = static_cast<double>(state.bytes - begin_bytes_) / (state.seconds - begin_s_);
    if (state.seconds - asked_s_ >= 0.25 || asked_s_ == 0) {
      free_ = options_.disk->free_bytes(options_.out);
      asked_s_ = std::max(state.seconds, 1e-9);
    }
    if (!free_) return true;
    state.free_bytes = *free_ > options_.keep_free_bytes ? *free_ - options_.keep_free_bytes : 0;
    if (state.bytes_per_s > 0) state.seconds_left = static_cast<double>(state.free_bytes) / state.bytes_per_s;
    return state.free_bytes > 0 && static_cast<double>(state.free_bytes) > kAhead_s * state.bytes_per_s;
  }

 private:
  const RecordOptions& options_;
  std::optional<std::uint64_t> free_;
  double begin_s_ = 0, asked_s_ = 0;
  std::uint64_t begin_bytes_ = 0;
};

/// A recording from its first thread to its last byte.
class Recorder {
 public:
  Recorder(const LiveSettings& settings, LiveDevices& devices, const RecordOptions& options, RecordingFiles& files)
      : settings_(settings),
        options_(options),
        files_(files),
        images_(std::make_unique<ImageIntake>(*devices.camera, options.waiting_bytes, wake_,
                                              camera_count(settings.config.devices))),
        readings_(std::make_unique<ReadingIntake>(*devices.imu, devices.turns)),
        writer_(files, *images_, *readings_, wake_) {}

  /// Throws std::system_error if the system cannot start a thread.
  void start() {
    start_ns_ = monotonic_ns();
    writer_.start();
    const RealtimeConfig& r = settings_.config.realtime;
    const bool started = imu_thread_.start(settings_of(FlightThread::kImu, r), [this] {
      return readings_->step();
    }) && camera_thread_.start(settings_of(FlightThread::kCapture, r), [this] { return images_->step(); });
    if (!started)
      throw std::system_error(std::make_error_code(std::errc::resource_unavailable_try_again), "no thread left");
  }

  /// False: it must end, as `end` says, or because of a failure.
  bool step(RecordEnd& end) {
    update();
    rates_.step(state_);
    if (!space_.step(state_)) return end = RecordEnd::kDiskFull, false;
    if (!is_described_ && state_.seconds > kStart_s && state_.image_rate_hz > 0) describe();
    if (state_.seconds >= options_.duration_s) return end = RecordEnd::kDuration, false;
    if (!camera_thread_.is_running() && !imu_thread_.is_running()) return end = RecordEnd::kSources, false;
    return !writer_.has_failed() && description_;
  }

  /// Ends the threads; what waits is written.
  Status stop() {
    camera_thread_.stop();
    imu_thread_.stop();
    writer_.stop(kWriteAtEnd);
    update();
    state_.counts.images_unwritten += writer_.left_over();
    if (writer_.has_failed()) return writer_.failure();
    if (state_.counts.images + state_.counts.readings > 0) describe();
    if (!description_) return description_.error();
    return files_.close();
  }

  const RecordState& state() const { return state_; }
  std::uint64_t rounds() const { return writer_.rounds(); }

 private:
  void update() {
    const std::int64_t now_ns = monotonic_ns();
    const auto silent_s = [&](std::int64_t newest_ns) {
      return Span{now_ns - std::max(newest_ns, start_ns_)}.seconds();
    };
    state_.seconds = Span{now_ns - start_ns_}.seconds();
    state_.counts = {writer_.images(),   images_->missed(),  images_->unwritten(), images_->old(),
                     images_->resized(), writer_.readings(), readings_->missed(),  readings_->unwritten()};
    state_.bytes = writer_.bytes();
    state_.camera_silent_s = silent_s(images_->newest_ns());
    state_.imu_silent_s = silent_s(readings_->newest_ns());
    state_.compress_ms = writer_.compress_ms();
    state_.write_ms = writer_.write_ms();
  }

  void describe() {
    is_described_ = true;
    const EstimatorConfig& e = settings_.config.estimator;
    RecordedSensors sensors{{}, {}, images_->width(), images_->height()};
    if (settings_.has_camera_calibration())
      sensors.cameras[0] = {settings_.camera, e.extrinsics.R_BC, e.extrinsics.p_BC, e.extrinsics.time_offset_s};
    for (std::size_t i = 0; i < kMostOthers; ++i) {
      if (!settings_.others[i]) continue;
      sensors.cameras[i + 1] = settings_.others[i];
      sensors.cameras[i + 1]->time_offset_s = e.extrinsics.time_offset_s;  // its stamps are on the first one's clock
    }
    if (!settings_.config.imu_calibration.empty())
      sensors.imu = {e.imu, e.saturation_gyroscope_rad_s, e.saturation_accelerometer_m_s2, settings_.imu_correction};
    sensors.image_rate_hz = static_cast<double>(state_.counts.images) / state_.seconds;
    sensors.reading_rate_hz = static_cast<double>(state_.counts.readings) / state_.seconds;
    description_ = files_.describe(sensors);
  }

  const LiveSettings& settings_;
  const RecordOptions& options_;
  RecordingFiles& files_;
  Parking wake_;
  std::unique_ptr<ImageIntake> images_;
  std::unique_ptr<ReadingIntake> readings_;
  RecordWriter writer_;
  StepThread imu_thread_, camera_thread_;
  std::int64_t start_ns_ = 0;
  RecordState state_;
  RateWatch rates_;
  SpaceWatch space_{options_};
  bool is_described_ = false;
  Status description_ = Done{};
};

/// Reports a running recording to the service manager.
class RecordService {
 public:
  RecordService() { manager_.ready(); }
  void stopping() { manager_.stopping(); }
  void round(const RecordState& state, std::uint64_t rounds) {
    if (!manager_.is_listening()) return;
    if (state.seconds - status_s_ >= 1) {
      manager_.status(fmt::format("recording: {} images, {} IMU samples, {} lost", state.counts.images,
                                  state.counts.readings, state.counts.lost()));
      status_s_ = state.seconds;
    }
    const double third_s = manager_.watchdog().seconds() / 3;  // so that one late round is no reason to be ended
    if (third_s <= 0 || state.seconds - alive_s_ < third_s || rounds == rounds_) return;
    manager_.alive();
    alive_s_ = state.seconds;
    rounds_ = rounds;
  }

 private:
  ServiceManager manager_;
  double status_s_ = 0, alive_s_ = 0;
  std::uint64_t rounds_ = 0;
};

Status enough_came(const RecordState& state, RecordEnd end) {
  const bool was_asked = end == RecordEnd::kSignal || end == RecordEnd::kWatch;
  if (was_asked && state.seconds < kStart_s) return Done{};
  const char* const missing = state.counts.images == 0     ? "image came from the camera"
                              : state.counts.readings == 0 ? "sample came from the IMU"
                                                           : nullptr;
  if (missing == nullptr) return Done{};
  return Error{ErrorKind::kRun, "", 0, fmt::format("no {} in {:.1f} s", missing, state.seconds),
               "a device that delivers: `epiline check` says what is wrong"};
}

/// record(), with what the system's lack of threads throws.
Result<RecordSummary> record_or_throw(const LiveSettings& settings, LiveDevices& devices, const RecordOptions& options,
                                      const std::function<bool(const RecordState&)>& watch) {
  const EndSignals signals;  // before any thread begins
  const auto files = RecordingFiles::create(options.out, *options.disk, camera_count(settings.config.devices));
  if (!files) return files.error();
  const auto free = options.disk->free_bytes(options.out);
  if (free && *free <= options.keep_free_bytes) {
    return Error{ErrorKind::kUsage, options.out.string(), 0,
                 fmt::format("{:.0f} MB are free", 1e-6 * static_cast<double>(*free)),
                 fmt::format("more than the {:.0f} MB that stay free (--keep-free)",
                             1e-6 * static_cast<double>(options.keep_free_bytes))};
  }
  OpenSensors sensors(devices);
  if (const Status s = sensors.open(signals); !s) return s.error();
  RecordSummary summary;
  Recorder recorder(settings, devices, options, **files);
  recorder.start();
  RecordService service;
  for (bool goes_on = true; goes_on;) {
    const bool is_asked = signals.ends(signals.wait(kRecordRound));
    goes_on = recorder.step(summary.end);
    service.round(recorder.state(), recorder.rounds());
    if (goes_on && is_asked) goes_on = (summary.end = RecordEnd::kSignal, false);
    if (goes_on && !watch(recorder.state())) goes_on = (summary.end = RecordEnd::kWatch, false);
  }
  service.stopping();
  const Status stopped = recorder.stop();
  summary.last = recorder.state();
  if (!stopped) return stopped.error();
  if (const Status s = enough_came(summary.last, summary.end); !s) return s.error();
  for (const auto& device : devices.records) summary.devices.push_back(device());
  return summary;
}

}  // namespace

Result<RecordSummary> record(const LiveSettings& settings, LiveDevices& devices, const RecordOptions& options,
                             const std::function<bool(const RecordState&)>& watch) {
  try {
    return record_or_throw(settings, devices, options, watch);
  } catch (const std::system_error& e) {
    return Error{ErrorKind::kRun, settings.source, 0, e.what(), "free threads and memory (ulimit -u, ulimit -l)"};
  }
}

std::vector<std::string> loss_lines(const RecordState& s) {
  std::vector<std::string> lines;
  const auto add = [&](std::uint64_t count, const char* what, const std::string& why) {
    if (count > 0) lines.push_back(fmt::format("{} {}{}: {}", count, what, count == 1 ? "" : "s", why));
  };
  const RecordCounts& c = s.counts;
  add(c.images_missed, "image", "the camera or its driver lost them (docs/camera.md)");
  const bool is_disk = s.write_ms > s.compress_ms;
  add(c.images_unwritten, "image",
      fmt::format("the {} is too slow: an image takes {:.1f} ms to compress and {:.1f} ms to write",
                  is_disk ? "disk" : "processor", s.compress_ms, s.write_ms));
  add(c.images_old, "image", "stamped no later than the image before");
  add(c.images_resized, "image", "not of the first image's size");
  add(c.readings_missed, "IMU sample", "gaps between timestamps");
  add(c.readings_unwritten, "IMU sample", "the disk did not take them in time");
  return lines;
}

}  // namespace epiline
