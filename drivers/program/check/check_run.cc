#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "drivers/program/check/bus_check.h"
#include "drivers/program/check/check.h"
#include "drivers/program/check/hand_wave.h"
#include "drivers/program/check/image_check.h"
#include "drivers/program/check/imu_check.h"
#include "drivers/program/check/line_check.h"
#include "drivers/program/check/value_check.h"
#include "drivers/program/check/watcher.h"
#include "drivers/program/live/devices.h"
#include "drivers/sensors/camera/v4l2_camera.h"
#include "platform/time/monotonic.h"

namespace epiline {

namespace {

constexpr Span kWait = Span::from_milliseconds(100);

/// Lines that stamp for a device which does not run: do edges come all the same?
class IdleLines {
 public:
  void add(const char* device, const std::string& line, int edge, Findings& out) {
    if (line.empty()) return;
    auto check = std::make_unique<LineCheck>(line, static_cast<Edge>(edge));
    if (const Status status = check->open()) {
      lines_.push_back({device, line, std::move(check)});
    } else {
      const Finding error = of_error(device, status.error());
      const auto is_same = [&](const Finding& f) { return f.text == error.text; };
      if (std::none_of(out.begin(), out.end(), is_same)) out.push_back(error);
    }
  }
  bool empty() const { return lines_.empty(); }
  void tell(Findings& out) {
    for (const Line& line : lines_) add_all(out, findings_of(line.check->so_far(), line.device, line.name));
  }

 private:
  struct Line {
    const char* device;
    std::string name;
    std::unique_ptr<LineCheck> check;
  };
  std::vector<Line> lines_;
};

/// The open devices; null: not open, or not configured.
struct Opened {
  CameraSource* camera = nullptr;
  const V4l2Camera* v4l2 = nullptr;  ///< the (first) camera's driver
  ImuSource* imu = nullptr;
  WheelSource* wheel = nullptr;
  HeightSource* height = nullptr;
};

/// The configured lens, or for the time before there is one a made-up one: corners are found and followed with any.
CameraParameters lens_to_look_with(const LiveSettings& settings, const Frame& image) {
  if (settings.has_camera_calibration()) return settings.camera;
  constexpr double kUsualFocalLength = 0.6;  // of the width
  CameraParameters lens;
  lens.width = image.width;
  lens.height = image.height;
  lens.intrinsics = {kUsualFocalLength * image.width, kUsualFocalLength * image.width, image.width / 2.0,
                     image.height / 2.0};
  return lens;
}

/// Images and readings, and whether they agree.
class Samples {
 public:
  Samples(const Opened& opened, const LiveSettings& settings, CheckWitness* witness)
      : opened_(opened), settings_(settings), config_(settings.config), witness_(witness) {
    forget();
    if (opened.camera != nullptr) camera_thread_.emplace([this] { return look_at_camera(); });
    if (opened.imu != nullptr) imu_thread_.emplace([this] { return look_at_imu(); });
  }
  ~Samples() { stop(); }
  Samples(const Samples&) = delete;
  Samples& operator=(const Samples&) = delete;

  bool have_ended() const {
    return (camera_thread_ || imu_thread_) && (!camera_thread_ || camera_thread_->has_ended()) &&
           (!imu_thread_ || imu_thread_->has_ended());
  }
  void stop() {
    camera_thread_.reset();
    imu_thread_.reset();
    if (newest_.data != nullptr) opened_.camera->give_back(std::exchange(newest_, {}));
  }
  /// Discards the data collected so far from images and IMU samples.
  void forget() {
    const std::scoped_lock lock(camera_mutex_, imu_mutex_);
    images_.reset();
    readings_ = {};
    // seen on a page, a wave must count for more than what the hand did before
    constexpr double kFadesOnAPage_s = 30;
    const double offset_s = config_.estimator.extrinsics.time_offset_s;
    wave_ = witness_ != nullptr ? std::make_unique<HandWave>(offset_s, kFadesOnAPage_s)
                                : std::make_unique<HandWave>(offset_s);
  }
  void tell(Findings& out) {
    if (opened_.camera != nullptr) tell_of_camera(out);
    if (opened_.imu != nullptr) {
      const std::lock_guard lock(imu_mutex_);
      add_all(out, findings_of(readings_.result({monotonic_ns()}),
                               {config_.devices.imu.rate_hz, config_.estimator.imu.gyroscope_density,
                                config_.estimator.imu.accelerometer_density}));
    }
    if (opened_.camera == nullptr || opened_.imu == nullptr || !settings_.has_camera_calibration()) return;
    const std::lock_guard lock(camera_mutex_);  // the wave is judged by the camera's thread
    add_all(out, findings_of(wave_->agreement(), config_.estimator.extrinsics.R_BC,
                             config_.estimator.extrinsics.time_offset_s));
  }

 private:
  static bool goes_on(ReadOutcome outcome) {
    if (outcome == ReadOutcome::kFailed) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    return outcome != ReadOutcome::kEnd;
  }
  void tell_of_camera(Findings& out) {
    const std::lock_guard lock(camera_mutex_);
    add_all(out, findings_of(images_ ? images_->result({monotonic_ns()}) : ImageResult(),
                             config_.devices.camera.rate_hz, config_.tracker.max_features));
    if (opened_.v4l2 == nullptr) return;
    if (images_) add_all(out, findings_of(exposure_, config_.devices.camera.exposure.automatic));
    add_all(out, findings_of(opened_.v4l2->reading()));
    add_all(out, findings_of(opened_.v4l2->focus()));
    out.push_back(finding_of_stamps(config_.devices.camera));
    const std::string& line = config_.devices.camera.stamp_line;
    if (!line.empty()) add_all(out, findings_of(opened_.v4l2->edge_counts(), opened_.v4l2->line_counts(), line));
  }
  bool look_at_camera() {
    Frame frame;
    const ReadOutcome outcome = opened_.camera->read(frame, kWait);
    if (outcome != ReadOutcome::kSample) return Watcher::goes_on(outcome);
    if (frame.arrival.ns == 0) frame.arrival = {monotonic_ns()};
    const std::lock_guard lock(camera_mutex_);
    if (opened_.v4l2 != nullptr) exposure_ = opened_.v4l2->exposure_report();
    if (!images_) images_.emplace(Camera(lens_to_look_with(settings_, frame)), config_.tracker);
    const TrackedFrame& tracked = images_->step(frame);
    wave_->add_images(tracked);
    if (witness_ != nullptr) witness_->image(frame, tracked, images_->newest_edge_px());
    if (newest_.data != nullptr) opened_.camera->give_back(newest_);  // the tracker compares two
    newest_ = frame;
    return true;
  }
  bool look_at_imu() {
    std::array<ImuSample, 64> samples;
    std::size_t count = 0;
    const ReadOutcome outcome = opened_.imu->read(samples, count, kWait);
    if (outcome != ReadOutcome::kSample) return Watcher::goes_on(outcome);
    const std::lock_guard lock(imu_mutex_);
    for (std::size_t i = 0; i < count; ++i) {
      settings_.imu_correction.apply(samples[i]);
      readings_.step(samples[i]);
      wave_->add_reading(samples[i]);
      if (witness_ != nullptr) witness_->reading(samples[i]);
    }
    return true;
  }

  const Opened opened_;
  const LiveSettings& settings_;
  const Config& config_;
  CheckWitness* witness_;
  // Both: the wave is replaced. Camera: images and the wave's judgement. IMU: readings, and those handed to the wave.
  std::mutex camera_mutex_, imu_mutex_;
  std::optional<ImageCheck> images_;
  ExposureReport exposure_;
  ImuCheck readings_;
  std::unique_ptr<HandWave> wave_;  // images by one thread, readings by the other
  Frame newest_;
  std::optional<Watcher> camera_thread_, imu_thread_;  // last: they use the others
};

/// All that can be made and opened: what one lacks does not keep the others from being looked at.
class Devices {
 public:
  Devices(const LiveSettings& settings, Findings& out) {
    MadeDevices made = make_each_device(settings);
    say_unless_said("camera", made.camera, out);
    say_unless_said("imu", made.imu, out);
    say_unless_said("height", made.height, out);
    devices_ = std::move(made.devices);
    open_outputs(out);
    opened_.camera = opened(devices_.camera.get(), "camera", out);
    opened_.v4l2 = devices_.v4l2;
    opened_.imu = opened(devices_.imu.get(), "imu", out);
    opened_.wheel = opened(devices_.wheel.get(), "wheel", out);
    opened_.height = opened(devices_.height.get(), "height", out);
    for (const Finding& f : out)
      if (f.grade == Grade::kError) not_open_.push_back(f.device);
  }
  ~Devices() {
    if (opened_.camera != nullptr) opened_.camera->close();
    if (opened_.imu != nullptr) opened_.imu->close();
    if (opened_.wheel != nullptr) opened_.wheel->close();
    if (opened_.height != nullptr) opened_.height->close();
    for (LiveOutput& output : devices_.outputs) output.sink->close();
  }
  Devices(const Devices&) = delete;
  Devices& operator=(const Devices&) = delete;

  const Opened& are_open() const { return opened_; }
  bool has_open_output() const { return has_open_output_; }
  /// What drivers counted; nothing of a device that could not be opened.
  void tell(Findings& out) const {
    for (const auto& record : devices_.records) {
      const DeviceRecord r = record();
      const bool is_open = std::find(not_open_.begin(), not_open_.end(), r.name) == not_open_.end();
      if (is_open) add_all(out, findings_of(r));
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
      const Status status = output.sink->open();
      if (!status) out.push_back(of_error(device, status.error()));
      has_open_output_ |= static_cast<bool>(status);
    }
  }

  LiveDevices devices_;
  Opened opened_;
  bool has_open_output_ = false;
  std::vector<std::string> not_open_;
};

/// Everything that is looked at, for as long as the options say.
class Look {
 public:
  Look(const LiveSettings& settings, const CheckOptions& options, Findings found)
      : options_(options),
        found_(std::move(found)),
        buses_(settings.config.devices, found_),
        devices_(settings, found_) {
    const DevicesConfig& d = settings.config.devices;
    const Opened& open = devices_.are_open();
    if (open.camera == nullptr) lines_.add("camera", d.camera.stamp_line, d.camera.stamp_edge, found_);
    if (open.imu == nullptr) lines_.add("imu", d.imu.ready_line, d.imu.ready_edge, found_);
    samples_.emplace(open, settings, options.witness);
    if (open.wheel != nullptr) wheel_.emplace(*open.wheel);
    if (open.height != nullptr) height_.emplace(*open.height);
    const HeightModels& heights = settings.config.estimator.heights;
    const bool is_barometer_alone = static_cast<HeightOrigin>(d.height.source) == HeightOrigin::kIio;
    wanted_heights_ = {heights[0].use, heights[1].use && !is_barometer_alone};
    is_worth_it_ = open.camera != nullptr || open.imu != nullptr || wheel_ || height_ || !lines_.empty() ||
                   devices_.has_open_output() || options.witness != nullptr;
  }

  void wait() {
    if (!is_worth_it_) return;
    const std::int64_t begin_ns = monotonic_ns();
    for (int round = 0;; ++round) {
      const double passed = 1e-9 * static_cast<double>(monotonic_ns() - begin_ns);
      const bool is_over = samples_->have_ended() && !wheel_ && !height_ && lines_.empty();
      if (passed >= options_.seconds || is_over || (options_.watch && !options_.watch(passed))) return;
      if (options_.witness != nullptr && round % 20 == 19) show(passed);
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
  }
  /// What would be said now.
  Findings tell() {
    Findings out = found_;
    samples_->tell(out);
    lines_.tell(out);
    if (wheel_) add_all(out, findings_of_wheels(wheel_->so_far()));
    if (height_) add_all(out, findings_of_heights(height_->so_far(), wanted_heights_));
    devices_.tell(out);
    buses_.tell(out);
    return out;
  }
  Findings end() {
    samples_->stop();
    return tell();
  }

 private:
  void show(double passed_s) {
    if (options_.witness->takes_new_start()) samples_->forget();
    options_.witness->findings(passed_s, tell());
  }

  const CheckOptions& options_;
  Findings found_;  ///< before anything was looked at
  BusCheck buses_;
  Devices devices_;
  IdleLines lines_;
  std::optional<Samples> samples_;
  std::optional<WheelCheck> wheel_;
  std::optional<HeightCheck> height_;
  std::array<bool, kHeightKinds> wanted_heights_{};
  bool is_worth_it_ = false;
};

}  // namespace

Findings check_devices(const std::filesystem::path& config_file, const CheckOptions& options) {
  const auto file = ConfigFile::read(config_file, options.set);
  if (!file) return {of_error("configuration", file.error())};
  Config config;
  file->apply(config);
  Findings found = check_presence(config.devices, list_devices());
  const auto settings = read_live_settings(config_file, options.set, CalibrationNeed::kIfGiven);
  if (!settings) {
    found.push_back(of_error("configuration", settings.error()));
    return found;
  }
  if (!settings->has_camera_calibration())
    DeviceFindings("configuration", found)
        .error("camera.calibration is not set: lens, time offset and rotation not checked",
               "calibrate: epiline calibrate --config FILE --board board.yaml --out DIR (docs/calibrate.md)");
  Look look(*settings, options, std::move(found));
  look.wait();
  return look.end();
}

}  // namespace epiline
