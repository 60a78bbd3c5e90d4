#include "drivers/hil/hil_run.h"

#include <algorithm>
#include <memory>
#include <mutex>
#include <optional>

#include "drivers/hil/can_thread.h"
#include "drivers/hil/controller_thread.h"
#include "drivers/hil/loopback_writer.h"
#include "drivers/hil/played_truth.h"
#include "drivers/hil/pump.h"
#include "drivers/hil/uhid_imu.h"
#include "drivers/replay/replay.h"
#include "pipeline/config/vehicle.h"
#include "pipeline/text/table.h"

namespace epiline::hil {

namespace {

constexpr Span kTail = Span::from_milliseconds(100);  // of readings after the last image
constexpr Span kLead = Span::from_milliseconds(500);  // before the first sample
constexpr Span kDrain = Span::from_milliseconds(500);
constexpr const char* kLoopback = "v4l2loopback:";

/// With the calibration that the configuration names.
Result<AslDataset> open_dataset(const HilOptions& o, const Config& c) {
  return is_bag(o.dataset) ? open_bag_dataset(o.dataset, {}, "cam0", c.camera_calibration, c.imu_calibration)
                           : open_asl_dataset(o.dataset, "cam0", c.camera_calibration, c.imu_calibration);
}

Result<FlightPlan> plan_of(const AslDataset& dataset, const HilOptions& o) {
  if (dataset.images.empty())
    return Error{ErrorKind::kUsage, o.dataset.string(), 0, "tracks in place of images", "a recording with images"};
  ReplayOptions replay;
  replay.start_s = o.start_s;
  replay.duration_s = o.duration_s;
  FlightPlan plan = plan_flight(dataset, replay);
  if (plan.images.empty()) {
    return Error{ErrorKind::kUsage, o.dataset.string(), 0, "no image in the time asked for",
                 "a shorter --start or a longer --duration"};
  }
  return plan;
}

/// One flight: who plays, into what, and who listens. Everything that is pointed to stays where it is.
class Flight {
 public:
  Flight(const HilOptions& options, LiveSettings settings, AslDataset dataset, FlightPlan plan)
      : options_(options),
        settings_(std::move(settings)),
        dataset_(std::move(dataset)),
        plan_(std::move(plan)),
        truth_(dataset_.ground_truth ? &*dataset_.ground_truth : nullptr),
        camera_(std::make_unique<PlayedCamera>(dataset_, plan_, clock_, options_.disturbance)),
        imu_(std::make_unique<PlayedImu>(dataset_, plan_, clock_, options_.disturbance)) {
    imu_->end_after(plan_.images.back().stamp + kTail);
  }

  Result<HilResult> run(const std::function<bool(const Progress&)>& watch);

 private:
  Status connect_controller();
  Status connect_camera(LiveDevices& devices);
  Status connect_imu(LiveDevices& devices);
  void begin();
  double share_played() const;
  bool watch_flight();
  Result<HilResult> judge(FlightRecord record);

  HilOptions options_;
  LiveSettings settings_;
  AslDataset dataset_;
  FlightPlan plan_;
  PlayClock clock_;
  std::once_flag begun_;
  PlayedTruth truth_;
  std::unique_ptr<PlayedCamera> camera_;
  std::unique_ptr<PlayedImu> imu_;
  PlayedCamera* played_camera_ = camera_.get();  ///< whoever owns it
  LoopbackWriter loopback_;
  UhidImu uhid_;
  std::unique_ptr<ControllerModel> model_;
  std::unique_ptr<ControllerLine> line_;
  std::optional<ControllerThread> controller_;
  std::optional<CanThread> bus_;
  Pump images_, readings_;
  std::int64_t played_ns_ = 0;  ///< when everything had been played
};

/// The controller waits at its end; the configuration gets the name of ours.
Status Flight::connect_controller() {
  ControllerSettings s;
  MavlinkConfig& m = settings_.config.devices.mavlink;
  s.system = static_cast<std::uint8_t>(m.system);
  s.companion = static_cast<std::uint8_t>(m.component);
  s.skew_ppm = options_.controller_skew_ppm;
  s.boot = Span{monotonic_ns()} - Span::from_milliseconds(60'000);
  s.R_VB = R_VB_of(settings_.config.devices.body);
  if (options_.controller.find("can") != std::string::npos && options_.controller.front() != '/') {
    s.on_can = true;
    s.can_base_id = settings_.config.devices.can.base_id;
  }
  s.wants_origin = m.has_origin() && !s.on_can;
  model_ = std::make_unique<ControllerModel>(s, [this](HostStamp stamp) {
    return clock_.started() ? truth_.at(clock_.pace().stamp_of(stamp.ns)) : std::nullopt;
  });
  if (s.on_can) {
    settings_.config.devices.can.interface = options_.controller;
    bus_.emplace(*model_);
    return bus_->start(options_.controller);
  }
  const bool udp = options_.controller == "udp", pty = options_.controller == "pty";
  auto line = pty ? open_pty_line() : udp ? open_udp_line() : open_serial_line(options_.controller, m.baud);
  if (!line) return line.error();
  line_ = std::move(*line);
  if (pty) m.serial = line_->companion_end(), m.udp = "";
  if (udp) m.udp = line_->companion_end(), m.serial = m.udp_listen = "";
  controller_.emplace(*model_, *line_);
  return Done{};
}

Status Flight::connect_camera(LiveDevices& devices) {
  if (const Status s = camera_->open(); !s) return s;  // images ready before anything begins
  if (options_.camera == "file") {
    devices.camera = std::move(camera_);
    devices.images_to_log = RecordedCamera::kImagesToLog;
    return Done{};
  }
  const std::string device = options_.camera.substr(std::string_view(kLoopback).size());
  CameraConfig& c = settings_.config.devices.camera;
  if (const Status s = loopback_.open(device, dataset_.camera.parameters.width, dataset_.camera.parameters.height); !s)
    return s;
  // What a loopback has not: controls, an exposure, a clock that anybody vouches for. Recorded stamps are mid-exposure.
  CameraConfig played;
  played.device = device;
  played.buffers = c.buffers;
  played.silence_ms = c.silence_ms;
  played.trust_stamps = true;
  played.stamp_point = 1;  // the start of an exposure of no length
  c = played;
  images_.start(*camera_, [this](const Frame& frame) { return loopback_.write(frame); });
  return Done{};
}

Status Flight::connect_imu(LiveDevices& devices) {
  if (options_.imu == "file") {
    devices.imu = std::move(imu_);
    return Done{};
  }
  ImuDeviceConfig& i = settings_.config.devices.imu;
  if (options_.imu == "mavlink") {
    i.driver = static_cast<int>(ImuDriver::kMavlink);
    model_->when_readings_are_wanted([this] { begin(); });  // the driver opens only when readings come
    readings_.start(*imu_, [this](const ImuSample& sample) { return model_->feed(sample); });
    return Done{};
  }
  if (const Status s = uhid_.plug_in(); !s) return s;
  i.driver = static_cast<int>(ImuDriver::kIio);
  i.device = uhid_.gyroscope_device();
  i.device_accel = uhid_.accelerometer_device();
  readings_.start(*imu_, [this](const ImuSample& sample) {
    const DeviceStamp hub{sample.stamp.ns};
    return uhid_.send_gyroscope(hub, sample.angular_velocity_rad_s) &&
           uhid_.send_accelerometer(hub, sample.specific_force_m_s2);
  });
  return Done{};
}

/// Plays from now on, unless it does already.
void Flight::begin() {
  std::call_once(begun_, [this] {
    HostStamp first = plan_.images.front().stamp;
    if (plan_.first_imu < dataset_.imu_samples.size())
      first = std::min(first, dataset_.imu_samples[plan_.first_imu].stamp);
    clock_.start(first, monotonic_ns() + kLead.ns);
  });
}

double Flight::share_played() const {
  if (!clock_.started()) return 0;
  const Pace& pace = clock_.pace();
  const Span played{monotonic_ns() - pace.host_ns}, all = plan_.images.back().stamp - pace.stamp;
  return std::clamp(played.seconds() / std::max(all.seconds(), 1e-3), 0.0, 1.0);
}

/// Twenty times a second: begins when everything is open, ends when everything has been played and gone through.
bool Flight::watch_flight() {
  const std::int64_t now_ns = monotonic_ns();
  begin();
  if (images_.is_running() || readings_.is_running() || now_ns < clock_.pace().host_of(plan_.images.back().stamp)) {
    played_ns_ = now_ns;
    return true;
  }
  return now_ns < played_ns_ + kDrain.ns;
}

Result<HilResult> Flight::run(const std::function<bool(const Progress&)>& watch) {
  if (const Status s = connect_controller(); !s) return s.error();
  LiveDevices given;
  if (const Status s = connect_camera(given); !s) return s.error();
  if (const Status s = connect_imu(given); !s) return s.error();
  if (controller_ && !controller_->start()) return Error{ErrorKind::kRun, "", 0, "no thread for the controller", ""};
  auto devices = make_devices(settings_, std::move(given));
  if (!devices) return devices.error();
  LiveOptions live;
  live.out = options_.out;
  auto record = fly(settings_, *devices, live, [&](const LiveState& state) {
    const bool goes_on = watch({share_played(), state});
    return watch_flight() && goes_on;
  });
  if (controller_) controller_->stop();
  if (bus_) bus_->stop();
  images_.stop();
  readings_.stop();
  if (!record) return record.error();
  if (played_camera_->error()) return *played_camera_->error();
  return judge(std::move(*record));
}

Result<HilResult> Flight::judge(FlightRecord record) {
  HilResult result;
  result.begin = HostStamp{clock_.pace().host_ns};
  result.verdict = model_->finish(HostStamp{clock_.pace().host_of(plan_.images.back().stamp)});
  result.estimates = model_->estimates();
  result.images_played = plan_.images.size();
  result.images_late = played_camera_->missed();
  result.images_refused = images_.failed();
  result.readings_refused = readings_.failed();
  record.dataset_path = options_.dataset.string();
  if (dataset_.ground_truth) record.truth = played(*dataset_.ground_truth, clock_.pace());
  if (!options_.out.empty()) {
    const std::string text = text_of(result.verdict, result.begin);
    if (const Status s = write_text(options_.out / "verdict.txt", text); !s) return s.error();
    if (const auto errors = write_report(record, options_.out); !errors) return errors.error();
  }
  result.record = std::move(record);
  return result;
}

}  // namespace

Result<HilResult> run_hil(const HilOptions& options, const std::function<bool(const Progress&)>& watch) {
  auto settings = read_live_settings(options.config_file);
  if (!settings) return settings.error();
  auto dataset = open_dataset(options, settings->config);
  if (!dataset) return dataset.error();
  auto plan = plan_of(*dataset, options);
  if (!plan) return plan.error();
  Flight flight(options, std::move(*settings), std::move(*dataset), std::move(*plan));
  return flight.run(watch);
}

}  // namespace epiline::hil
