#include "drivers/check/check.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <memory>
#include <thread>

#include "drivers/camera/v4l2_camera.h"
#include "drivers/check/can_listen.h"
#include "drivers/check/hand_wave.h"
#include "drivers/check/image_check.h"
#include "drivers/check/imu_check.h"
#include "platform/time/monotonic.h"

namespace epiline {

namespace {

constexpr std::size_t kMostForTheWave = 200'000;  // readings; later ones are not compared with the camera
constexpr Span kWait = Span::from_milliseconds(100);

Finding found(Grade grade, std::string device, std::string text, std::string remedy = {}) {
  return {grade, std::move(device), std::move(text), std::move(remedy)};
}

bool is_listed(const std::vector<ListedDevice>& devices, const std::string& wanted) {
  return std::any_of(devices.begin(), devices.end(),
                     [&](const ListedDevice& d) { return d.path == wanted || d.name == wanted; });
}

/// A device file, or the name of a listed device.
void check_file(const char* device, const char* key, const std::string& wanted, const std::vector<ListedDevice>& listed,
                Findings& out, bool has_other_names = false) {
  std::string path = wanted;
  if (wanted.empty() || wanted[0] != '/') {
    const auto named = std::find_if(listed.begin(), listed.end(), [&](const auto& d) { return d.name == wanted; });
    if (named != listed.end()) path = named->path;
  }
  if (wanted.empty())
    out.push_back(found(Grade::kError, device, fmt::format("{} is not set", key), "there are: " + to_text(listed)));
  else if (path[0] == '/' && !std::filesystem::exists(path))
    out.push_back(
        found(Grade::kError, device, fmt::format("no {}", wanted),
              fmt::format("plugged in, powered, driver loaded? Correct {}; there are: {}", key, to_text(listed))));
  else if (path[0] != '/' && has_other_names && !listed.empty())
    return;  // a bus: opening it will tell
  else if (path[0] != '/')
    out.push_back(
        found(Grade::kError, device, fmt::format("none is called \"{}\"", wanted),
              fmt::format("plugged in, powered, driver loaded? Correct {}; there are: {}", key, to_text(listed))));
  else if (const auto remedy = permission_remedy(path))
    out.push_back(found(Grade::kError, device, fmt::format("no permission to open {}", path), *remedy));
  else
    out.push_back(found(Grade::kOk, device, fmt::format("{} is there", wanted)));
}

void check_line(const char* device, const std::string& line, const Inventory& inventory, Findings& out) {
  if (line.empty()) return;
  if (inventory.gpio.empty()) {
    out.push_back(found(Grade::kError, device, fmt::format("no GPIO chip for the line {}", line),
                        "is the driver of the pins loaded? gpiodetect shows chips"));
    return;
  }
  for (const ListedDevice& chip : inventory.gpio)
    if (const auto remedy = permission_remedy(chip.path))
      out.push_back(found(Grade::kWarning, device, fmt::format("no permission to open {}", chip.path), *remedy));
}

void check_interface(const char* device, const char* key, const std::string& interface, const Inventory& inventory,
                     Findings& out) {
  if (interface.empty()) return;
  if (is_listed(inventory.can, interface)) return;  // opening it will tell
  out.push_back(found(Grade::kError, device, fmt::format("no CAN interface {}", interface),
                      fmt::format("driver loaded? Correct {}; there are: {}", key, to_text(inventory.can))));
}

bool has_error(const Findings& findings, const std::string& device) {
  return std::any_of(findings.begin(), findings.end(),
                     [&](const Finding& f) { return f.grade == Grade::kError && f.device == device; });
}

Finding of_error(const char* device, const Error& error) {
  const Error plain{error.kind, error.file, error.line, error.found, ""};
  return found(Grade::kError, device, plain.text(), error.expected.empty() ? "" : "expected " + error.expected);
}

// Takes a place, so that the others can be made.
class NoCamera final : public CameraSource {
  Status open() override { return Done{}; }
  void close() noexcept override {}
  ReadOutcome read(Frame& /*frame*/, Span /*timeout*/) noexcept override { return ReadOutcome::kEnd; }
  void give_back(const Frame& /*frame*/) noexcept override {}
};
class NoImu final : public ImuSource {
  Status open() override { return Done{}; }
  void close() noexcept override {}
  ReadOutcome read(std::span<ImuSample> /*samples*/, std::size_t& /*count*/, Span /*timeout*/) noexcept override {
    return ReadOutcome::kEnd;
  }
};

/// The buses that are configured, and what is heard on them.
class Buses {
 public:
  Buses(const DevicesConfig& config, Findings& out) : config_(config) {
    add("can", config.can.interface, out);
    add("wheel", config.wheel.interface, out);
  }
  void tell(Findings& out) {
    for (auto& [device, interface, listener] : listeners_) {
      const auto ids = listener->heard();
      std::uint64_t frames = 0;
      for (const auto& [id, count] : ids) frames += count;
      const std::string text = fmt::format("{} frames of {} identifiers heard on {}", frames, ids.size(), interface);
      const bool is_wheel = std::string_view(device) == "wheel";
      const auto wheel_id = static_cast<std::uint32_t>(config_.wheel.id);
      if (is_wheel && ids.count(wheel_id) == 0)
        out.push_back(found(Grade::kError, device, fmt::format("{}, none with 0x{:x}", text, wheel_id),
                            "is the sender on? same bit rate? wheel.id as candump shows it?"));
      else if (frames == 0)
        out.push_back(found(Grade::kWarning, device, text,
                            "nobody else talks: if somebody should, look at bit rate, termination (120 Ohm at both "
                            "ends), wires"));
      else
        out.push_back(found(Grade::kOk, device, text));
    }
  }

 private:
  struct Listener {
    const char* device;
    std::string interface;
    std::unique_ptr<CanListener> listener;
  };
  void add(const char* device, const std::string& interface, Findings& out) {
    if (interface.empty() || has_error(out, device)) return;
    auto listener = std::make_unique<CanListener>();
    if (const Status opened = listener->open(interface); !opened)
      out.push_back(of_error(device, opened.error()));
    else
      listeners_.push_back({device, interface, std::move(listener)});
  }
  const DevicesConfig& config_;
  std::vector<Listener> listeners_;
};

void say_exposure(const ExposureReport& e, const CameraConfig& config, Findings& out) {
  const double ms = 1e3 * e.time.seconds();
  const std::string text =
      fmt::format("exposure {:.2f} ms, gain {:.2f}{}", ms, e.gain, e.is_automatic ? ", automatic" : "");
  if (e.time.ns == 0)
    out.push_back(found(Grade::kWarning, "camera", "the exposure time is not known: stamps are off by half of it",
                        "name camera.exposure_control, or set camera.exposure_ms"));
  else if (ms > 15)
    out.push_back(found(Grade::kWarning, "camera", text, "turns will smear images: below 10, more light or more gain"));
  else
    out.push_back(found(Grade::kOk, "camera", text));
  if (config.exposure.automatic && e.refused > 0)
    out.push_back(found(Grade::kError, "camera", fmt::format("{} changes of exposure or gain refused", e.refused),
                        "is the camera's own automatic exposure off (camera.controls)?"));
}

}  // namespace

Findings check_presence(const DevicesConfig& d, const Inventory& inventory) {
  Findings out;
  check_file("camera", "camera.device", d.camera.device, inventory.cameras, out, true);
  check_line("camera", d.camera.stamp_line, inventory, out);
  switch (static_cast<ImuDriver>(d.imu.driver)) {
    case ImuDriver::kMavlink:
      break;  // comes over the link below
    case ImuDriver::kIio:
      check_file("imu", "imu.device", d.imu.device, inventory.iio, out);
      if (!d.imu.device_accel.empty()) check_file("imu", "imu.device_accel", d.imu.device_accel, inventory.iio, out);
      break;
    default:
      check_file("imu", "imu.device", d.imu.device, inventory.spi, out);
      if (!d.imu.device_accel.empty()) check_file("imu", "imu.device_accel", d.imu.device_accel, inventory.spi, out);
  }
  check_line("imu", d.imu.ready_line, inventory, out);
  if (!d.mavlink.serial.empty()) check_file("mavlink", "mavlink.serial", d.mavlink.serial, inventory.serial, out);
  check_interface("can", "can.interface", d.can.interface, inventory, out);
  check_interface("wheel", "wheel.interface", d.wheel.interface, inventory, out);
  return out;
}

Findings findings_of(const DeviceRecord& record) {
  Findings out;
  // what drivers count that should not have happened
  constexpr std::array kBad = {"damaged",       "incomplete",    "bad_stamps", "no_slot",           "overwritten",
                               "disconnected",  "gaps",          "lost",       "disordered",        "overflows",
                               "resets",        "not_rising",    "duplicates", "overrun",           "refused_values",
                               "refused_times", "bad_checksums", "strangers",  "refused_questions", "refused_answers",
                               "write_errors"};
  std::string text;
  for (const auto& [name, count] : record.counts)
    if (count > 0 && std::find(kBad.begin(), kBad.end(), name) != kBad.end())
      text += fmt::format("{}{} {}", text.empty() ? "" : ", ", name, count);
  if (!text.empty())
    out.push_back(found(Grade::kWarning, record.name, "its driver counted: " + text,
                        "cables, supply, other load on the bus; docs of the driver name each"));
  const auto packets =
      std::find_if(record.counts.begin(), record.counts.end(), [](const auto& c) { return c.first == "packets"; });
  if (packets != record.counts.end()) {
    if (packets->second == 0)
      out.push_back(found(Grade::kError, record.name, "no flight controller heard",
                          "TX and RX crossed? same baud rate? MAVLink on that port of the controller?"));
    else
      out.push_back(found(Grade::kOk, record.name, fmt::format("{} packets heard", packets->second)));
  }
  if (!record.clock) return out;
  const ClockState& c = *record.clock;
  const std::string clock =
      fmt::format("clock: skew {:+.1f} ppm, residual {:.3f} ms (most {:.3f}), {} jumps", c.skew_ppm,
                  1e3 * c.residual_rms.seconds(), 1e3 * c.residual_most.seconds(), c.jumps);
  switch (c.status) {
    case ClockStatus::kEmpty:
      out.push_back(found(Grade::kWarning, record.name, "clock: no sample of it", "does the device answer?"));
      break;
    case ClockStatus::kUnusable:
      out.push_back(
          found(Grade::kError, record.name, clock, "runs off by more than any crystal: wrong tick, wrong clock"));
      break;
    case ClockStatus::kSettling:
      out.push_back(found(Grade::kWarning, record.name, clock, "not settled: look longer (--seconds 20)"));
      break;
    case ClockStatus::kLocked:
      out.push_back(found(c.jumps > 0 ? Grade::kWarning : Grade::kOk, record.name, clock,
                          c.jumps > 0 ? "does the device restart? its supply" : ""));
  }
  return out;
}

Findings check_samples(CameraSource* camera, ImuSource* imu, const LiveSettings& settings,
                       const CheckOptions& options) {
  ImageCheck images(Camera(settings.camera), settings.config.tracker);
  ImuCheck readings;
  HandWave wave;
  std::atomic<bool> stop{false}, camera_ended{camera == nullptr}, imu_ended{imu == nullptr};
  const auto pause = [] { std::this_thread::sleep_for(std::chrono::milliseconds(10)); };
  std::thread of_camera([&] {
    Frame frame, last;
    while (camera != nullptr && !stop) {
      const ReadOutcome outcome = camera->read(frame, kWait);
      if (outcome == ReadOutcome::kEnd) break;
      if (outcome == ReadOutcome::kFailed) pause();
      if (outcome != ReadOutcome::kSample) continue;
      if (frame.arrival.ns == 0) frame.arrival = {monotonic_ns()};
      wave.add_images(images.step(frame));
      if (last.data != nullptr) camera->give_back(last);
      last = frame;
    }
    if (last.data != nullptr) camera->give_back(last);
    camera_ended = true;
  });
  std::thread of_imu([&] {
    std::array<ImuSample, 64> samples;
    std::size_t taken = 0;
    while (imu != nullptr && !stop) {
      std::size_t count = 0;
      const ReadOutcome outcome = imu->read(samples, count, kWait);
      if (outcome == ReadOutcome::kEnd) break;
      if (outcome == ReadOutcome::kFailed) pause();
      if (outcome != ReadOutcome::kSample) continue;
      for (std::size_t i = 0; i < count; ++i) {
        readings.step(samples[i]);
        if (taken++ < kMostForTheWave) wave.add_reading(samples[i]);
      }
    }
    imu_ended = true;
  });
  const std::int64_t begin_ns = monotonic_ns();
  for (;;) {
    const double passed = 1e-9 * static_cast<double>(monotonic_ns() - begin_ns);
    const bool is_over = (camera != nullptr || imu != nullptr) && camera_ended && imu_ended;
    if (passed >= options.seconds || is_over || (options.watch && !options.watch(passed))) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(is_over ? 1 : 250));
  }
  stop = true;
  of_camera.join();
  of_imu.join();

  Findings out;
  const auto add = [&out](const Findings& more) { out.insert(out.end(), more.begin(), more.end()); };
  const Config& config = settings.config;
  if (camera != nullptr) add(findings_of(images.result(), config.devices.camera.rate_hz, config.tracker.max_features));
  if (imu != nullptr)
    add(findings_of(readings.result(), {config.devices.imu.rate_hz, config.estimator.imu.gyroscope_density,
                                        config.estimator.imu.accelerometer_density}));
  if (camera != nullptr && imu != nullptr)
    add(findings_of(wave.result(), config.estimator.extrinsics.R_BC, config.estimator.extrinsics.time_offset_s));
  return out;
}

Findings check_devices(const std::filesystem::path& config_file, const CheckOptions& options) {
  const auto file = ConfigFile::read(config_file);
  if (!file) return {of_error("configuration", file.error())};
  Config config;
  file->apply(config);
  Findings out = check_presence(config.devices, list_devices());
  Buses buses(config.devices, out);
  const auto settings = read_live_settings(config_file);
  if (!settings) {
    out.push_back(of_error("configuration", settings.error()));
    return out;
  }
  const auto add = [&out](const Findings& more) { out.insert(out.end(), more.begin(), more.end()); };

  LiveDevices camera_only, rest;
  if (!has_error(out, "camera")) {
    LiveDevices others;
    others.imu = std::make_unique<NoImu>();
    if (auto made = make_devices(*settings, std::move(others)))
      camera_only = std::move(*made);
    else
      out.push_back(of_error("camera", made.error()));
  }
  LiveDevices others;
  others.camera = std::make_unique<NoCamera>();
  const bool wants_imu = !has_error(out, "imu");
  if (!wants_imu) others.imu = std::make_unique<NoImu>();
  if (auto made = make_devices(*settings, std::move(others)))
    rest = std::move(*made);
  else
    out.push_back(of_error("imu", made.error()));

  for (LiveOutput& output : rest.outputs)
    if (const Status opened = output.sink->open(); !opened) out.push_back(of_error("output", opened.error()));
  const auto open = [&out](auto& source, const char* device) {
    if (!source || has_error(out, device)) return false;
    const Status opened = source->open();
    if (!opened) out.push_back(of_error(device, opened.error()));
    return static_cast<bool>(opened);
  };
  const bool has_camera = open(camera_only.camera, "camera"), has_imu = wants_imu && open(rest.imu, "imu");
  if (has_camera || has_imu || !rest.outputs.empty())
    add(check_samples(has_camera ? camera_only.camera.get() : nullptr, has_imu ? rest.imu.get() : nullptr, *settings,
                      options));
  if (has_camera) {
    for (const auto& record : camera_only.records)
      if (const DeviceRecord r = record(); r.name == "camera") add(findings_of(r));
    if (const auto* v4l2 = dynamic_cast<const V4l2Camera*>(camera_only.camera.get()))
      say_exposure(v4l2->exposure_report(), config.devices.camera, out);
  }
  for (const auto& record : rest.records) add(findings_of(record()));
  buses.tell(out);
  if (has_camera) camera_only.camera->close();
  if (has_imu) rest.imu->close();
  for (LiveOutput& output : rest.outputs) output.sink->close();
  return out;
}

}  // namespace epiline
