#include "drivers/program/check/check.h"

#include <fmt/format.h>
#include <linux/can.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <memory>
#include <optional>
#include <thread>

#include "drivers/links/can/messages.h"
#include "drivers/program/check/camera_findings.h"
#include "drivers/program/check/can_listen.h"
#include "drivers/program/check/hand_wave.h"
#include "drivers/program/check/image_check.h"
#include "drivers/program/check/imu_check.h"
#include "drivers/program/check/line_check.h"
#include "drivers/program/check/watcher.h"
#include "drivers/program/check/wheel_check.h"
#include "drivers/program/live/devices.h"
#include "drivers/sensors/camera/v4l2_camera.h"
#include "platform/time/monotonic.h"

namespace epiline {

namespace {

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
    out.push_back(found(Grade::kError, device, fmt::format("{} is not set", key), "choose one of: " + to_text(listed)));
  else if (path[0] == '/' && !std::filesystem::exists(path))
    out.push_back(found(Grade::kError, device, fmt::format("{} does not exist", wanted),
                        fmt::format("is it plugged in, powered, its driver loaded? Else correct {}; present: {}", key,
                                    to_text(listed))));
  else if (path[0] != '/' && has_other_names && !listed.empty())
    return;  // a bus: opening it will tell
  else if (path[0] != '/')
    out.push_back(found(Grade::kError, device, fmt::format("no device is called \"{}\"", wanted),
                        fmt::format("is it plugged in, powered, its driver loaded? Else correct {}; present: {}", key,
                                    to_text(listed))));
  else if (const auto remedy = permission_remedy(path))
    out.push_back(found(Grade::kError, device, fmt::format("no permission to open {}", path), *remedy));
  else
    out.push_back(found(Grade::kOk, device, fmt::format("{} is present", wanted)));
}

void check_line(const char* device, const std::string& line, const Inventory& inventory, Findings& out) {
  if (line.empty()) return;
  if (inventory.gpio.empty()) {
    out.push_back(found(Grade::kError, device, fmt::format("no GPIO chip for the line {}", line),
                        "load the driver of the pins; gpiodetect lists the chips"));
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
                      fmt::format("is its driver loaded? Else correct {}; present: {}", key, to_text(inventory.can))));
}

bool has_error(const Findings& findings, const std::string& device) {
  return std::any_of(findings.begin(), findings.end(),
                     [&](const Finding& f) { return f.grade == Grade::kError && f.device == device; });
}

void add_all(Findings& out, const Findings& more) { out.insert(out.end(), more.begin(), more.end()); }

Finding of_error(const std::string& device, const Error& error) {
  const Error plain{error.kind, error.file, error.line, error.found, ""};
  return found(Grade::kError, device, plain.text(), error.expected.empty() ? "" : "expected " + error.expected);
}

/// The buses that are configured, and what is heard on them.
class Buses {
 public:
  Buses(const DevicesConfig& config, Findings& out) : config_(config) {
    add("can", config.can.interface, out);
    add("wheel", config.wheel.interface, out);
  }
  void tell(Findings& out) {
    for (auto& [device, interface, listener] : listeners_) {
      const std::uint32_t wheel_id =
          static_cast<std::uint32_t>(config_.wheel.id) | (config_.wheel.extended ? CAN_EFF_FLAG : 0);
      std::uint64_t frames = 0, ids = 0;
      bool has_wheel = false;
      for (const auto& [id, count] : listener->heard()) {
        has_wheel = has_wheel || id == wheel_id;
        if (is_ours(interface, id)) continue;
        frames += count;
        ++ids;
      }
      const std::string text = fmt::format("{} frames with {} identifiers received on {}", frames, ids, interface);
      const bool is_wheel = std::string_view(device) == "wheel";
      if (is_wheel && !has_wheel)
        out.push_back(found(Grade::kError, device, fmt::format("{}, none with wheel.id 0x{:x}", text, config_.wheel.id),
                            "switch the sender on; compare the bit rate, wheel.id and wheel.extended with candump"));
      else if (frames == 0)
        out.push_back(
            found(Grade::kWarning, device, text,
                  "no other node sends; if one should, check bit rate, termination (120 Ohm at both ends) and "
                  "wires"));
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
  /// What this very check sends: the kernel lets all sockets of this computer hear it.
  bool is_ours(const std::string& interface, std::uint32_t id) const {
    const CanConfig& can = config_.can;
    const auto first = static_cast<std::uint32_t>(can.base_id);
    return interface == can.interface &&
           ((id >= first && id < first + can::kMessages.size()) ||
            (can.isotp_send_id != 0 && id == static_cast<std::uint32_t>(can.isotp_send_id)));
  }

  const DevicesConfig& config_;
  std::vector<Listener> listeners_;
};

/// Lines that stamp for a device which does not run: do edges come all the same?
class IdleLines {
 public:
  void add(const char* device, const std::string& line, int edge, Findings& out) {
    if (line.empty()) return;
    auto opened = std::make_unique<GpioLine>(line, static_cast<Edge>(edge));
    if (const Status status = opened->open(); !status) {
      const Finding error = of_error(device, status.error());
      const auto is_same = [&](const Finding& f) { return f.text == error.text; };
      if (std::none_of(out.begin(), out.end(), is_same)) out.push_back(error);
      return;
    }
    auto check = std::make_unique<LineCheck>(*opened);
    lines_.push_back({device, line, std::move(opened), std::move(check)});
  }
  bool empty() const { return lines_.empty(); }
  void tell(Findings& out) {
    for (const Line& line : lines_) add_all(out, findings_of(line.check->result(), line.device, line.name));
  }

 private:
  struct Line {
    const char* device;
    std::string name;
    std::unique_ptr<GpioLine> line;
    std::unique_ptr<LineCheck> check;  // after the line: it ends first
  };
  std::vector<Line> lines_;
};

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
  std::string text;
  for (const DeviceCount& c : record.counts)
    if (c.is_fault && c.value > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", c.name, c.value);
  if (!text.empty())
    out.push_back(
        found(Grade::kWarning, record.name, "its driver counted faults: " + text,
              "check cables, supply and other load on the bus; the page of the driver in docs explains each count"));
  const auto packets = std::find_if(record.counts.begin(), record.counts.end(),
                                    [](const DeviceCount& c) { return c.name == "packets"; });
  if (packets != record.counts.end()) {
    if (packets->value == 0)
      out.push_back(found(Grade::kError, record.name, "nothing received from a flight controller",
                          "cross TX and RX, set the same baud rate, switch MAVLink on at that port of the controller"));
    else
      out.push_back(found(Grade::kOk, record.name, fmt::format("{} packets received", packets->value)));
  }
  if (!record.clock) return out;
  const ClockState& c = *record.clock;
  const std::string clock =
      fmt::format("clock: skew {:+.1f} ppm, residual {:.3f} ms (at most {:.3f} ms), {} jumps", c.skew_ppm,
                  1e3 * c.residual_rms.seconds(), 1e3 * c.residual_most.seconds(), c.jumps);
  switch (c.status) {
    case ClockStatus::kEmpty:
      out.push_back(found(Grade::kWarning, record.name, "clock: the device sent no time",
                          "check that it answers; look longer (--seconds 20)"));
      break;
    case ClockStatus::kUnusable:
      out.push_back(found(Grade::kError, record.name, clock,
                          "it drifts more than any crystal: the driver assumes a wrong tick or a wrong clock"));
      break;
    case ClockStatus::kSettling:
      out.push_back(found(Grade::kWarning, record.name, clock, "not settled yet; look longer (--seconds 20)"));
      break;
    case ClockStatus::kLocked:
      out.push_back(found(c.jumps > 0 ? Grade::kWarning : Grade::kOk, record.name, clock,
                          c.jumps > 0 ? "the device may restart: check its supply" : ""));
  }
  return out;
}

namespace {

/// What is open; null: is not, or is not configured.
struct Opened {
  CameraSource* camera = nullptr;
  ImuSource* imu = nullptr;
  WheelSource* wheel = nullptr;
};

/// Images and readings, and whether they agree.
class Samples {
 public:
  Samples(const Opened& opened, const LiveSettings& settings)
      : opened_(opened),
        config_(settings.config),
        images_(Camera(settings.camera), settings.config.tracker),
        wave_(settings.config.estimator.extrinsics.time_offset_s) {
    if (opened.camera != nullptr) camera_thread_.emplace([this] { return look_at_camera(); });
    if (opened.imu != nullptr) imu_thread_.emplace([this] { return look_at_imu(); });
  }
  bool have_ended() const {
    return (camera_thread_ || imu_thread_) && (!camera_thread_ || camera_thread_->has_ended()) &&
           (!imu_thread_ || imu_thread_->has_ended());
  }
  /// Ends it.
  void tell(Findings& out) {
    camera_thread_.reset();
    imu_thread_.reset();
    if (newest_.data != nullptr) opened_.camera->give_back(newest_);
    if (opened_.camera != nullptr)
      add_all(out, findings_of(images_.result(), config_.devices.camera.rate_hz, config_.tracker.max_features));
    if (opened_.imu != nullptr)
      add_all(out,
              findings_of(readings_.result(), {config_.devices.imu.rate_hz, config_.estimator.imu.gyroscope_density,
                                               config_.estimator.imu.accelerometer_density}));
    if (opened_.camera != nullptr && opened_.imu != nullptr)
      add_all(out, findings_of(wave_.agreement(), config_.estimator.extrinsics.R_BC,
                               config_.estimator.extrinsics.time_offset_s));
  }

 private:
  static bool goes_on(ReadOutcome outcome) {
    if (outcome == ReadOutcome::kFailed) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    return outcome != ReadOutcome::kEnd;
  }
  bool look_at_camera() {
    Frame frame;
    const ReadOutcome outcome = opened_.camera->read(frame, kWait);
    if (outcome != ReadOutcome::kSample) return goes_on(outcome);
    if (frame.arrival.ns == 0) frame.arrival = {monotonic_ns()};
    wave_.add_images(images_.step(frame));
    if (newest_.data != nullptr) opened_.camera->give_back(newest_);  // the tracker compares two
    newest_ = frame;
    return true;
  }
  bool look_at_imu() {
    std::array<ImuSample, 64> samples;
    std::size_t count = 0;
    const ReadOutcome outcome = opened_.imu->read(samples, count, kWait);
    if (outcome != ReadOutcome::kSample) return goes_on(outcome);
    for (std::size_t i = 0; i < count; ++i) {
      readings_.step(samples[i]);
      wave_.add_reading(samples[i]);
    }
    return true;
  }

  const Opened opened_;
  const Config& config_;
  ImageCheck images_;
  ImuCheck readings_;
  HandWave wave_;  // images by one thread, readings by the other
  Frame newest_;
  std::optional<Watcher> camera_thread_, imu_thread_;  // last: they use the others
};

/// As long as `options` say, or until `is_over`.
void wait(const CheckOptions& options, const std::function<bool()>& is_over) {
  const std::int64_t begin_ns = monotonic_ns();
  for (;;) {
    const double passed = 1e-9 * static_cast<double>(monotonic_ns() - begin_ns);
    if (passed >= options.seconds || is_over() || (options.watch && !options.watch(passed))) return;
    std::this_thread::sleep_for(std::chrono::milliseconds(250));
  }
}

/// All that can be made and opened: what one lacks does not keep the others from being looked at.
class Devices {
 public:
  Devices(const LiveSettings& settings, Findings& out) {
    MadeDevices made = make_each_device(settings);
    say_unless_said("camera", made.camera, out);
    say_unless_said("imu", made.imu, out);
    devices_ = std::move(made.devices);
    open_outputs(out);
    opened_.camera = opened(devices_.camera.get(), "camera", out);
    opened_.imu = opened(devices_.imu.get(), "imu", out);
    opened_.wheel = opened(devices_.wheel.get(), "wheel", out);
    for (const Finding& f : out)
      if (f.grade == Grade::kError) not_open_.push_back(f.device);
  }
  ~Devices() {
    if (opened_.camera != nullptr) opened_.camera->close();
    if (opened_.imu != nullptr) opened_.imu->close();
    if (opened_.wheel != nullptr) opened_.wheel->close();
    for (LiveOutput& output : devices_.outputs) output.sink->close();
  }
  Devices(const Devices&) = delete;
  Devices& operator=(const Devices&) = delete;

  const Opened& are_open() const { return opened_; }
  bool has_outputs() const { return !devices_.outputs.empty(); }
  /// What drivers counted; nothing of a device that could not be opened.
  void tell(const CameraConfig& config, Findings& out) const {
    tell_records(out);
    if (const auto* v4l2 = dynamic_cast<const V4l2Camera*>(opened_.camera)) {
      add_all(out, findings_of(v4l2->exposure_report(), config.exposure.automatic));
      add_all(out, findings_of(v4l2->reading()));
      if (!config.stamp_line.empty())
        add_all(out, findings_of(v4l2->edge_counts(), v4l2->line_counts(), config.stamp_line));
    }
  }

 private:
  static void say_unless_said(const char* device, const Status& status, Findings& out) {
    if (!status && !has_error(out, device)) out.push_back(of_error(device, status.error()));
  }
  template <class Source>
  static Source* opened(Source* source, const char* device, Findings& out) {
    if (source == nullptr || has_error(out, device)) return nullptr;
    const Status status = source->open();
    if (!status) out.push_back(of_error(device, status.error()));
    return status ? source : nullptr;
  }
  void open_outputs(Findings& out) {
    for (LiveOutput& output : devices_.outputs) {
      const std::string device = output.name.substr(0, output.name.find(' '));
      if (has_error(out, device)) continue;
      if (const Status status = output.sink->open(); !status) out.push_back(of_error(device, status.error()));
    }
  }
  void tell_records(Findings& out) const {
    for (const auto& record : devices_.records) {
      const DeviceRecord r = record();
      const bool is_open = std::find(not_open_.begin(), not_open_.end(), r.name) == not_open_.end();
      if (is_open) add_all(out, findings_of(r));
    }
  }

  LiveDevices devices_;
  Opened opened_;
  std::vector<std::string> not_open_;
};

}  // namespace

Findings check_devices(const std::filesystem::path& config_file, const CheckOptions& options) {
  const auto file = ConfigFile::read(config_file, options.set);
  if (!file) return {of_error("configuration", file.error())};
  Config config;
  file->apply(config);
  const DevicesConfig& d = config.devices;
  Findings out = check_presence(d, list_devices());
  Buses buses(d, out);
  const auto settings = read_live_settings(config_file, options.set);
  if (!settings) {
    out.push_back(of_error("configuration", settings.error()));
    return out;
  }
  Devices devices(*settings, out);
  const Opened& open = devices.are_open();
  IdleLines lines;
  if (open.camera == nullptr) lines.add("camera", d.camera.stamp_line, d.camera.stamp_edge, out);
  if (open.imu == nullptr) lines.add("imu", d.imu.ready_line, d.imu.ready_edge, out);

  Samples samples(open, *settings);
  std::optional<WheelCheck> wheel;
  if (open.wheel != nullptr) wheel.emplace(*open.wheel);
  if (open.camera != nullptr || open.imu != nullptr || wheel || !lines.empty() || devices.has_outputs())
    wait(options, [&] { return samples.have_ended() && !wheel && lines.empty(); });
  samples.tell(out);
  lines.tell(out);
  if (wheel) add_all(out, findings_of(wheel->result()));
  devices.tell(d.camera, out);
  buses.tell(out);
  return out;
}

}  // namespace epiline
