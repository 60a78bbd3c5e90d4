#include "drivers/program/hil/hil_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <sstream>
#include <string_view>

#include "drivers/flights/recordings/bag.h"
#include "drivers/flights/recordings/bag_dataset.h"
#include "drivers/program/hil/controller_thread.h"
#include "drivers/program/hil/loopback_writer.h"
#include "drivers/program/hil/uhid_imu.h"
#include "drivers/study/report/outputs.h"
#include "pipeline/config/vehicle.h"
#include "pipeline/text/table.h"
#include "platform/linux/signals.h"
#include "platform/linux/step_thread.h"

namespace epiline::hil {

namespace {

constexpr Span kTail = Span::from_milliseconds(100);  // of readings after the last image
constexpr Span kLead = Span::from_milliseconds(500);  // before the first sample
constexpr Span kDrain = Span::from_milliseconds(500);
constexpr Span kRound = Span::from_milliseconds(50);  // between looks at a flight of another process
constexpr std::string_view kLoopback = "v4l2loopback:", kPty = "pty:", kUdp = "udp:";

/// What follows the prefix; none: it begins with something else.
std::optional<std::string> after(std::string_view prefix, const std::string& text) {
  return text.rfind(prefix, 0) == 0 ? std::optional(text.substr(prefix.size())) : std::nullopt;
}

/// The devices of v4l2loopback:DEVICE,DEVICE; none of another camera.
std::vector<std::string> loopbacks_of(const std::string& camera) {
  std::vector<std::string> devices;
  const auto list = after(kLoopback, camera);
  if (!list) return devices;
  std::istringstream text(*list);
  for (std::string device; std::getline(text, device, ',');) devices.push_back(device);
  return devices;
}

/// With the calibrations that the configuration names, and as many cameras as it has.
Result<AslDataset> open_dataset(const HilOptions& o, const Config& c) {
  const std::size_t cameras = camera_count(c.devices);
  if (is_bag(o.dataset)) {
    if (cameras > 1)
      return Error{ErrorKind::kUsage, o.dataset.string(), 0, "several cameras with a ROS bag", "an ASL folder"};
    return open_bag_dataset(o.dataset, {}, "cam0", c.camera_calibration, c.imu_calibration);
  }
  auto dataset = open_asl_dataset(o.dataset, "cam0", c.camera_calibration, c.imu_calibration);
  for (std::size_t i = 0; dataset && i + 1 < cameras; ++i) {
    const std::string& own = c.devices.other_cameras[i].calibration;
    const std::string& file = own.empty() ? c.camera_calibration : own;
    if (const Status s = open_other_camera(*dataset, fmt::format("cam{}", i + 1), file); !s) return s.error();
  }
  return dataset;
}

Result<FlightPlan> plan_of(const AslDataset& dataset, const HilOptions& o) {
  if (dataset.images.empty())
    return Error{ErrorKind::kUsage, o.dataset.string(), 0, "holds tracks instead of images", "a recording with images"};
  FlightPlan plan = plan_flight(dataset, {o.start_s, o.duration_s});
  if (plan.images.empty()) {
    return Error{ErrorKind::kUsage, o.dataset.string(), 0, "no image between --start and --duration",
                 "a shorter --start or a longer --duration"};
  }
  return plan;
}

/// 0: a single image. To a tenth, as cameras are configured.
double image_rate_hz(const FlightPlan& plan) {
  if (plan.images.size() < 2) return 0;
  const Span all = plan.images.back().stamp - plan.images.front().stamp;
  return std::round(10 * static_cast<double>(plan.images.size() - 1) / all.seconds()) / 10;
}

bool is_mavlink_line(const std::string& controller) {
  return controller == "pty" || controller == "udp" || controller.front() == '/' || after(kPty, controller) ||
         after(kUdp, controller);
}
bool is_bus(const std::string& controller) {
  return !is_mavlink_line(controller) && controller.find("can") != std::string::npos;
}

/// Checks that the configuration leads another process to the devices that are played here.
Status check_beside(const HilOptions& o, const LiveSettings& settings) {
  const DevicesConfig& d = settings.config.devices;
  const auto differs = [&](const char* key, const std::string& value, const std::string& played) {
    return Error{ErrorKind::kUsage, settings.source, 0, std::string(key) + " = \"" + value + "\"",
                 "\"" + played + "\", to which epiline hil plays"};
  };
  const auto not_found = [](const char* option, const std::string& value, const char* expected) {
    return Error{ErrorKind::kUsage, std::string("--beside with ") + option, 0, value, expected};
  };
  if (o.camera == "file")
    return not_found("--camera", o.camera, "v4l2loopback:DEVICE, which the other process can open");
  if (o.imu == "file") return not_found("--imu", o.imu, "uhid or mavlink, which the other process can open");
  if (o.controller == "pty" || o.controller == "udp")
    return not_found("--controller", o.controller, "pty:PATH, udp:PORT, a CAN interface or a serial port");
  const std::vector<std::string> played = loopbacks_of(o.camera);
  const auto others = std::count_if(d.other_cameras.begin(), d.other_cameras.end(),
                                    [](const OtherCameraConfig& c) { return !c.device.empty(); });
  if (played.size() != 1 + static_cast<std::size_t>(others))
    return not_found("--camera", o.camera,
                     fmt::format("a loopback device for each of the {} in the configuration", 1 + others).c_str());
  for (std::size_t i = 0; i < played.size(); ++i) {
    const std::string& device = i == 0 ? d.camera.device : d.other_cameras[i - 1].device;
    if (device.rfind("/dev/video", 0) == 0 && device != played[i])
      return differs(fmt::format("{}.device", i == 0 ? "camera" : kOtherCameraSections[i - 1]).c_str(), device,
                     played[i]);
  }
  if (is_bus(o.controller) && d.can.interface != o.controller)
    return differs("can.interface", d.can.interface, o.controller);
  if (const auto path = after(kPty, o.controller); path && d.mavlink.serial != path)
    return differs("mavlink.serial", d.mavlink.serial, *path);
  return Done{};
}

/// One flight: the players, the devices that they play into, and the controller. Not movable, because parts hold
/// pointers.
class Flight {
 public:
  Flight(const HilOptions& options, LiveSettings settings, AslDataset dataset, FlightPlan plan)
      : options_(options),
        settings_(std::move(settings)),
        dataset_(std::move(dataset)),
        plan_(std::move(plan)),
        camera_(std::make_unique<PlayedCamera>(dataset_, plan_, clock_, options_.disturbance)),
        imu_(std::make_unique<PlayedImu>(dataset_, plan_, clock_, options_.disturbance)) {
    settings_.imu_correction = dataset_.imu.correction;
    imu_->end_after(plan_.images.back().stamp + kTail);
  }

  Result<HilResult> run(const std::function<void(const Progress&)>& watch);

 private:
  Status connect_controller();
  Status connect_line(bool on_can);
  Status connect_camera(LiveDevices& devices);
  Status open_loopbacks(const std::vector<std::string>& devices);
  bool play(const Frame& frame);
  Status connect_imu(LiveDevices& devices);
  Status play_readings(std::function<bool(const ImuSample&)> deliver);
  static Status start_playing(StepThread& thread, const char* name, std::function<bool()> step);
  void begin();
  double share_played() const;
  bool watch_flight();
  Status stand_by(const EndSignals& signals, const std::function<void(const Progress&)>& watch);
  Result<HilResult> judge(std::optional<FlightRecord> record);
  Status write(HilResult& result);

  HilOptions options_;
  LiveSettings settings_;
  AslDataset dataset_;
  FlightPlan plan_;
  PlayClock clock_;
  std::once_flag begun_;
  std::unique_ptr<PlayedCamera> camera_;
  std::unique_ptr<PlayedImu> imu_;
  PlayedCamera* played_camera_ = camera_.get();  ///< whoever owns it
  std::array<LoopbackWriter, kMostOthers + 1> loopbacks_;
  bool side_by_side_ = false;  ///< two cameras in one loopback
  UhidImu uhid_;
  std::unique_ptr<ControllerModel> model_;
  std::unique_ptr<ControllerLine> line_;
  std::optional<ControllerThread> controller_;
  std::uint64_t images_refused_ = 0, readings_refused_ = 0;
  StepThread images_, readings_;
  std::int64_t played_ns_ = 0;  ///< when everything had been played
};

/// The controller waits at its end; the configuration gets the name of ours.
Status Flight::connect_controller() {
  ControllerSettings s;
  MavlinkConfig& m = settings_.config.devices.mavlink;
  s.system = static_cast<std::uint8_t>(m.system);
  s.companion = static_cast<std::uint8_t>(m.component);
  s.skew_ppm = 40;  // as quartzes have
  s.boot = Span{monotonic_ns()} - Span::from_milliseconds(60'000);
  s.R_VB = R_VB_of(settings_.config.devices.body);
  s.on_can = is_bus(options_.controller);
  s.can_base_id = settings_.config.devices.can.base_id;
  s.wants_origin = m.has_origin() && !s.on_can;
  s.is_ardupilot = s.wants_origin || (options_.judge & kEveryPx4) == 0;
  ControllerModel::Truth truth;
  if (dataset_.ground_truth) {
    truth = [this](HostStamp stamp) {
      return clock_.started() ? truth_at(*dataset_.ground_truth, clock_.pace().stamp_of(stamp.ns)) : std::nullopt;
    };
  }
  model_ = std::make_unique<ControllerModel>(s, std::move(truth));
  if (const Status status = connect_line(s.on_can); !status) return status;
  return s.on_can ? controller_->start() : Done{};  // frames may come from now on
}

Status Flight::connect_line(bool on_can) {
  MavlinkConfig& m = settings_.config.devices.mavlink;
  const std::string& where = options_.controller;
  const auto path = after(kPty, where), port = after(kUdp, where);
  const bool is_pty = path || where == "pty", is_udp = port || where == "udp";
  auto line = on_can   ? ControllerLine::open_can(where)
              : is_pty ? ControllerLine::open_pty(path.value_or(""))
              : is_udp ? ControllerLine::open_udp(std::atoi(port.value_or("0").c_str()))
                       : ControllerLine::open_serial(where, m.baud);
  if (!line) return line.error();
  line_ = std::move(*line);
  if (on_can) settings_.config.devices.can.interface = where;
  if (is_pty) m.serial = line_->companion_end(), m.udp = "";
  if (is_udp) m.udp = line_->companion_end(), m.serial = m.udp_listen = "";
  std::optional<mavlink::SigningKey> key;
  if (!on_can && !m.signing_key_file.empty()) {
    const auto read = mavlink::read_signing_key(m.signing_key_file);
    if (!read) return read.error();
    key = *read;
  }
  controller_.emplace(*model_, *line_, key);
  return Done{};
}

Status Flight::connect_camera(LiveDevices& devices) {
  if (const Status s = camera_->open(); !s) return s;  // images ready before anything begins
  if (options_.camera == "file") {
    for (std::size_t i = 0; i < kMostOthers; ++i)
      settings_.config.estimator.others[i].apart_s = plan_.apart[i].seconds();
    devices.camera = std::move(camera_);
    devices.images_to_log = RecordedCamera::kImagesToLog;
    return Done{};
  }
  const std::vector<std::string> played = loopbacks_of(options_.camera);
  if (const Status s = open_loopbacks(played); !s) return s;
  DevicesConfig& d = settings_.config.devices;
  // What a loopback has not: controls, an exposure, a clock that anybody vouches for. Recorded stamps are mid-exposure.
  CameraConfig c;
  c.device = played.front();
  c.silence_ms = d.camera.silence_ms;
  c.rate_hz = image_rate_hz(plan_);
  c.trust_stamps = true;
  c.stamp_point = 1;  // the start of an exposure of no length
  if (side_by_side_) c.side_by_side = static_cast<int>(SideBySideHalves::kLeftFirst);
  d.camera = c;
  for (std::size_t i = 0; i < kMostOthers; ++i) {
    OtherCameraConfig& other = d.other_cameras[i];
    other.device = i + 1 < played.size() ? played[i + 1] : "";
    other.sensor = other.stamp_line = "";
    other.free_running = plan_.apart[i] > Span{};
    settings_.config.estimator.others[i].apart_s = other.free_running ? pairs_within_s(d, i) : 0;
  }
  return start_playing(images_, "images", [this] {
    Frame frame;
    const ReadOutcome outcome = camera_->read(frame, kRound);
    if (outcome != ReadOutcome::kSample) return outcome != ReadOutcome::kEnd;
    if (!play(frame)) ++images_refused_;
    camera_->give_back(frame);
    return true;
  });
}

/// One for each camera, or one for two that were triggered together.
Status Flight::open_loopbacks(const std::vector<std::string>& devices) {
  const auto fault = [&](const std::string& found, const char* expected) {
    return Error{ErrorKind::kUsage, options_.dataset.string(), 0, found, expected};
  };
  const std::size_t cameras = 1 + dataset_.others.size();
  side_by_side_ = devices.size() == 1 && cameras == 2;
  if (devices.size() != cameras && !side_by_side_)
    return fault(fmt::format("{} of its cameras with {} loopback devices", cameras, devices.size()),
                 "a device for each, separated by commas, or one for two side by side; or --camera file");
  if (side_by_side_ && plan_.apart[0] > Span{})
    return fault("two cameras that were not triggered together",
                 "a loopback device for each, or --camera file: one device shows both side by side, as of one time");
  for (std::size_t i = 0; i < devices.size(); ++i) {
    const CameraParameters& lens = i == 0 ? dataset_.camera.parameters : dataset_.others[i - 1]->camera.parameters;
    const int width = lens.width * (side_by_side_ ? 2 : 1);
    if (const Status s = loopbacks_[i].open(devices[i], width, lens.height, image_rate_hz(plan_)); !s) return s;
  }
  return Done{};
}

/// The others' images first: the run waits for them once it has the first camera's.
bool Flight::play(const Frame& frame) {
  const auto others = camera_->others(frame);
  if (side_by_side_) return loopbacks_[0].write(frame, others[0]);
  bool good = true;
  for (std::size_t i = 0; i < others.size(); ++i)
    if (others[i].data != nullptr) good = loopbacks_[i + 1].write(others[i]) && good;
  return loopbacks_[0].write(frame) && good;
}

Status Flight::connect_imu(LiveDevices& devices) {
  if (options_.imu == "file") {
    devices.imu = std::move(imu_);
    return Done{};
  }
  ImuDeviceConfig& i = settings_.config.devices.imu;
  if (options_.imu == "mavlink") {
    i.driver = static_cast<int>(ImuDriver::kMavlink);
    model_->when_readings_are_wanted([this] { begin(); });  // a driver that opens only when readings come
    return play_readings([this](const ImuSample& sample) { return model_->feed(sample); });
  }
  if (const Status s = uhid_.plug_in(); !s) return s;
  i.driver = static_cast<int>(ImuDriver::kIio);
  i.device = uhid_.gyroscope_device();
  i.device_accel = uhid_.accelerometer_device();
  return play_readings([this](const ImuSample& sample) {
    const DeviceStamp hub{sample.stamp.ns};
    return uhid_.send_gyroscope(hub, sample.angular_velocity_rad_s) &&
           uhid_.send_accelerometer(hub, sample.specific_force_m_s2);
  });
}

/// `deliver`: false if the kernel refused the sample.
Status Flight::play_readings(std::function<bool(const ImuSample&)> deliver) {
  return start_playing(readings_, "samples", [this, deliver = std::move(deliver)] {
    std::array<ImuSample, 16> samples;
    std::size_t got = 0;
    const ReadOutcome outcome = imu_->read(samples, got, kRound);
    for (std::size_t i = 0; i < got; ++i)
      if (!deliver(samples[i])) ++readings_refused_;
    return outcome != ReadOutcome::kEnd;
  });
}

/// The thread stands for hardware, which a busy computer does not slow down: above all ordinary threads, below
/// everything under test.
Status Flight::start_playing(StepThread& thread, const char* name, std::function<bool()> step) {
  if (thread.start({.name = name, .priority = 1}, std::move(step))) return Done{};
  return Error{ErrorKind::kRun, "", 0, std::string("no thread that plays the ") + name, ""};
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

/// Another process flies: plays from when it has opened the IMU, the first of the two that it opens.
Status Flight::stand_by(const EndSignals& signals, const std::function<void(const Progress&)>& watch) {
  for (bool goes_on = true; goes_on;) {
    goes_on = !signals.ends(signals.wait(kRound));
    if (uhid_.is_on()) begin();
    const bool begun = clock_.started();
    watch({share_played(), !begun});
    if (begun) goes_on = watch_flight() && goes_on;
  }
  if (clock_.started()) return Done{};
  return Error{ErrorKind::kRun, "", 0, "no program opened the IMU",
               "epiline run with " + settings_.source + " in another terminal"};
}

Result<HilResult> Flight::run(const std::function<void(const Progress&)>& watch) {
  const EndSignals signals;  // before any thread begins
  if (const Status s = connect_controller(); !s) return s.error();
  LiveDevices devices;  // to the end: the played camera may be one of them, and is asked when all is over
  if (const Status s = connect_camera(devices); !s) return s.error();
  if (const Status s = connect_imu(devices); !s) return s.error();
  if (!model_->is_on_can())
    if (const Status s = controller_->start(); !s) return s.error();
  std::optional<FlightRecord> record;
  Status flown = Done{};
  if (options_.beside) {
    flown = stand_by(signals, watch);
  } else {
    auto made = make_devices(settings_, std::move(devices));
    if (!made) return made.error();
    devices = std::move(*made);
    LiveOptions live;
    live.out = options_.out;
    auto flight = fly(settings_, devices, live, [&](const LiveState& state) {
      watch({share_played(), false});
      return !state.waiting_for.empty() || watch_flight();
    });
    if (flight) record = std::move(*flight);
    if (!flight) flown = flight.error();
  }
  controller_->stop();
  images_.stop();
  readings_.stop();
  if (!flown) return flown.error();
  if (played_camera_->error()) return *played_camera_->error();
  return judge(std::move(record));
}

Result<HilResult> Flight::judge(std::optional<FlightRecord> record) {
  HilResult result;
  result.begin = HostStamp{clock_.pace().host_ns};
  // a flight that was ended early is judged up to its end only
  const std::int64_t end_ns = std::min(clock_.pace().host_of(plan_.images.back().stamp), monotonic_ns());
  result.verdict = model_->finish(HostStamp{end_ns});
  result.estimates = model_->estimates();
  result.images_played = plan_.images.size();
  result.images_late = played_camera_->missed();
  result.images_refused = images_refused_;
  result.readings_refused = readings_refused_;
  result.received = model_->received();
  if (dataset_.ground_truth) result.truth = *dataset_.ground_truth;
  for (TimedPose& pose : result.truth.poses) pose.stamp.ns = clock_.pace().host_of(pose.stamp);
  if (record) {
    record->dataset_path = options_.dataset.string();
    if (dataset_.ground_truth) record->truth = result.truth;
  }
  result.record = std::move(record);
  if (!options_.out.empty()) {
    if (const Status s = write(result); !s) return s.error();
  }
  return result;
}

Status Flight::write(HilResult& result) {
  const std::filesystem::path& out = options_.out;
  if (const Status s = make_folder(out); !s) return s;
  if (const Status s = write_text(out / "verdict.txt", text_of(result.verdict, result.begin, options_.judge)); !s)
    return s;
  std::string received;
  for (const Trajectory& part : result.received) received += tum_text(part);
  if (const Status s = write_text(out / "received.tum", received); !s) return s;
  if (const Status s = write_text(out / "truth.tum", tum_text(result.truth)); !s) return s;
  if (!result.record) return Done{};
  const auto errors = write_report(*result.record, out);
  return errors ? Status(Done{}) : Status(errors.error());
}

}  // namespace

Result<HilResult> run_hil(const HilOptions& options, const std::function<void(const Progress&)>& watch) {
  auto settings = read_live_settings(options.config_file, options.set);
  if (!settings) return settings.error();
  if (options.beside) {
    if (const Status s = check_beside(options, *settings); !s) return s.error();
  }
  auto dataset = open_dataset(options, settings->config);
  if (!dataset) return dataset.error();
  auto plan = plan_of(*dataset, options);
  if (!plan) return plan.error();
  Flight flight(options, std::move(*settings), std::move(*dataset), std::move(*plan));
  return flight.run(watch);
}

}  // namespace epiline::hil
