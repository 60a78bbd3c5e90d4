#include "drivers/program/live/devices.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "drivers/flights/recordings/mask_file.h"
#include "drivers/links/can/can_output.h"
#include "drivers/links/mavlink/link.h"
#include "drivers/program/dds/dds_output.h"
#include "drivers/program/live/controller_advice.h"
#include "drivers/sensors/camera/camera_pair.h"
#include "drivers/sensors/camera/side_by_side.h"
#include "drivers/sensors/camera/v4l2_camera.h"
#include "drivers/sensors/height/iio_pressure.h"
#include "drivers/sensors/height/mavlink_height.h"
#include "drivers/sensors/imu/iio_imu.h"
#include "drivers/sensors/imu/mavlink_imu.h"
#include "drivers/sensors/imu/spi_imu_device.h"
#include "drivers/sensors/wheel/can_wheel_source.h"
#include "pipeline/config/vehicle.h"
#include "platform/time/monotonic.h"

namespace epiline {

namespace {

Error missing(const LiveSettings& settings, std::string found, std::string expected) {
  return {ErrorKind::kUsage, settings.source, 0, std::move(found), std::move(expected)};
}

bool is_side_by_side(const Config& config) { return config.devices.camera.side_by_side != 0; }

Result<V4l2Settings> v4l2_settings(const LiveSettings& settings) {
  CameraConfig c = settings.config.devices.camera;
  const bool is_calibrated = settings.has_camera_calibration();
  const int width = settings.camera.width * (is_side_by_side(settings.config) ? 2 : 1);
  if (c.width == 0) c.width = width;
  if (c.height == 0) c.height = settings.camera.height;
  if (is_calibrated && (c.width != width || c.height != settings.camera.height))
    return missing(settings, fmt::format("camera.width = {}, camera.height = {}", c.width, c.height),
                   fmt::format("{} x {}, {}the image size in camera.calibration", width, settings.camera.height,
                               is_side_by_side(settings.config) ? "twice the width of " : ""));
  if (is_side_by_side(settings.config) && c.width % 2 != 0)
    return missing(settings, fmt::format("camera.width = {}", c.width),
                   "an even number, as camera.side_by_side wants two halves");
  auto s = v4l2_settings_of(c);
  if (!s) return missing(settings, s.error().file + ": " + s.error().found, s.error().expected);
  s->focal_px = is_calibrated ? settings.config.estimator.extrinsics.focal_px : 0;
  return s;
}

template <class Counts, std::size_t N>
DeviceRecord device_record(const char* device, const std::array<Counter<Counts>, N>& counters, const Counts& counts,
                           std::optional<ClockState> clock) {
  DeviceRecord record{device, {}, std::move(clock), {}, {}};
  for (const Counter<Counts>& c : counters) record.counts.push_back({c.name, counts.*c.value, c.is_fault});
  return record;
}

DeviceRecord record_of(const char* name, const V4l2Camera& camera) {
  return device_record(name, kCameraCounters, camera.counts(),
                       camera.has_own_clock() ? std::optional(camera.clock_state()) : std::nullopt);
}

DeviceRecord record_of(const IioImu& imu) {
  const bool own_clock = imu.clock() == IioClock::kDevice;
  return device_record("imu", kIioCounters, imu.counts(), own_clock ? std::optional(imu.clock_state()) : std::nullopt);
}

DeviceRecord record_of(const SpiImu& imu) {
  const SpiImuCounts counts = imu.counts();
  DeviceRecord record = device_record("imu", kSpiImuCounters, counts, imu.clock_state());
  const double tolerance = imu.facts().clock_tolerance;
  if (tolerance > 0 && counts.clock_rate > 0 && std::abs(counts.clock_rate - 1) > tolerance) {
    record.refusal = fmt::format("the chip's clock runs at {:.4f} of what it should", counts.clock_rate);
    record.remedy =
        "expected 1.000 within 0.02, so timestamps are wrong: is another chip fitted, or one with an "
        "external clock? Report it with the marking of the chip";
  }
  return record;
}

DeviceRecord record_of(const MavlinkImu& imu) {
  return device_record("imu", mavlink::kControllerImuCounters, imu.counts(), imu.clock_state());
}

DeviceRecord record_of(const MavlinkHeight& height) {
  return device_record("height", mavlink::kControllerHeightCounters, height.counts(), height.clock_state());
}

OutputRecord record_of(const mavlink::MavlinkLink& link, const std::string& name) {
  const mavlink::LinkCounts c = link.counts();
  return {name, c.odometry, c.dropped, c.disconnected, link.latency()};
}

std::vector<std::string> notes_of(const mavlink::LinkState& s, const MavlinkConfig& config) {
  std::vector<std::string> notes;
  for (const DeviceAdvice& a : advice_of(s.answers, config)) notes.push_back(a.text + "; " + a.remedy);
  if (std::string use = use_of(s, HostStamp{monotonic_ns()}); !use.empty()) notes.push_back(std::move(use));
  return notes;
}

DeviceRecord device_of(const mavlink::MavlinkLink& link, const MavlinkConfig& config) {
  const mavlink::LinkState s = link.state();
  DeviceRecord record = device_record("mavlink", mavlink::kLinkCounters, s.counts, s.clock);
  record.counts.push_back({"controller_component", s.peer.address.component});
  record.counts.push_back({"controller_type", s.peer.type});
  record.counts.push_back({"heap_calls", s.costs.heap_calls});
  record.counts.push_back({"lock_calls", s.costs.lock_calls});
  record.refusal = sentence_of(s.refusal);
  record.remedy = remedy_of(s.refusal);
  record.advice = advice_of(s.answers, config);
  record.note = survey_note(s.answers);
  return record;
}

OutputRecord record_of(const CanOutput& can, const std::string& name) {
  const CanOutputCounts c = can.counts();
  return {name, c.epochs, c.dropped, c.disconnected, can.latency()};
}

DeviceRecord device_of(const CanOutput& can) { return device_record("can", kCanCounters, can.counts(), std::nullopt); }

DeviceRecord record_of(const IioPressure& pressure) {
  return device_record("height", kPressureCounters, pressure.counts(), std::nullopt);
}

DeviceRecord record_of(const CanWheelSource& wheel) {
  const ClockState clock = wheel.hardware_clock();
  return device_record("wheel", kWheelCounters, wheel.counts(),
                       clock.status == ClockStatus::kEmpty ? std::nullopt : std::optional(clock));
}

}  // namespace

namespace {

/// Hands a device over, with what its driver counts.
template <class Device, class Port>
void take(std::unique_ptr<Device> device, std::unique_ptr<Port>& port, LiveDevices& devices) {
  devices.records.emplace_back([d = device.get()] { return record_of(*d); });
  port = std::move(device);
}

/// After the first one. `other`: of the other cameras, from 0.
Status read_other_camera(LiveSettings& settings, std::size_t other) {
  Config& config = settings.config;
  const std::string name = fmt::format("cam{}", other + 1), section = kOtherCameraSections[other];
  const OtherCameraConfig& device = config.devices.other_cameras[other];
  if (device.calibration.empty() && !is_chain_with(config.camera_calibration, name))
    return missing(settings, fmt::format("{}.calibration is not set, and camera.calibration has no {}", section, name),
                   fmt::format("the {}'s calibration (docs/camera.md, Several cameras)", kOtherCameraNames[other]));
  auto camera =
      read_camera_calibration(device.calibration.empty() ? config.camera_calibration : device.calibration, name);
  if (!camera) return camera.error();
  CameraParameters& p = camera->parameters;
  set_shutter(config.devices.camera, p);
  if (p.width != settings.camera.width || p.height != settings.camera.height)
    return missing(settings, fmt::format("a {} of {} x {}", kOtherCameraNames[other], p.width, p.height),
                   fmt::format("{} x {}, as the first one", settings.camera.width, settings.camera.height));
  config.estimator.others[other] = {true, camera->R_BC, camera->p_BC, p.readout_s,
                                    device.free_running ? pairs_within_s(config.devices, other) : 0};
  settings.others[other] = *camera;
  return read_mask(other + 1, p, config);
}

Status read_camera(LiveSettings& settings) {
  Config& config = settings.config;
  auto camera = read_camera_calibration(config.camera_calibration, "cam0");
  if (!camera) return camera.error();
  set_shutter(config.devices.camera, camera->parameters);
  set_calibration(*camera, config.estimator);
  settings.camera = camera->parameters;
  if (const Status s = read_mask(0, settings.camera, config); !s) return s;
  for (std::size_t other = 0; other + 1 < camera_count(config.devices); ++other)
    if (const Status s = read_other_camera(settings, other); !s) return s;
  return Done{};
}

}  // namespace

Result<LiveSettings> read_live_settings(const std::filesystem::path& config_file, const std::vector<std::string>& set,
                                        CalibrationNeed need) {
  const auto file = ConfigFile::read(config_file, set);
  if (!file) return file.error();
  LiveSettings settings;
  settings.source = config_file.string();
  settings.is_flown = need == CalibrationNeed::kRequired;
  Config& config = settings.config;
  file->apply(config);  // for the names of calibration files
  if (!config.camera_calibration.empty()) {
    if (const Status s = read_camera(settings); !s) return s.error();
  } else if (need == CalibrationNeed::kRequired) {
    return missing(settings, "camera.calibration is not set",
                   "a calibration file of the camera, for instance Kalibr's camchain-imucam.yaml (docs/calibrate.md)");
  }
  if (!config.imu_calibration.empty()) {
    const auto imu = read_imu_calibration(config.imu_calibration);
    if (!imu) return imu.error();
    set_calibration(*imu, config.estimator);
    settings.imu_correction = imu->correction;
  }
  file->apply(config);  // the file wins
  const auto& others = config.devices.other_cameras;
  if (!others[0].device.empty() && is_side_by_side(config))
    return missing(settings, "camera.side_by_side and second_camera.device", "one of them");
  for (std::size_t i = camera_count(config.devices); i <= kMostOthers; ++i)
    if (!others[i - 1].device.empty())
      return missing(settings, fmt::format("a {}, but no {}", kOtherCameraNames[i - 1], kOtherCameraNames[i - 2]),
                     fmt::format("{}.device", kOtherCameraSections[i - 2]));
  if (const Status s = mavlink::fault_of_frame(config.devices.mavlink); !s)
    return missing(settings, s.error().file + ": " + s.error().found, s.error().expected);
  set_vehicle(config);
  return settings;
}

namespace {

/// Another camera, which is set as the first one, and exposed as that is.
std::unique_ptr<V4l2Camera> other_camera(const LiveSettings& settings, std::size_t other, V4l2Settings set,
                                         V4l2Camera& first, LiveDevices& devices) {
  const OtherCameraConfig& c = settings.config.devices.other_cameras[other];
  set.device = c.device;
  set.sensor = c.sensor;
  set.stamp_line = c.stamp_line;
  set.control_of_exposure.automatic = false;
  auto camera = std::make_unique<V4l2Camera>(std::move(set));
  if (settings.config.devices.camera.exposure.automatic) camera->follow_exposure_of(first);
  devices.records.emplace_back([c = camera.get(), other] { return record_of(kOtherCameraNames[other], *c); });
  return camera;
}

PairSettings pair_settings(const LiveSettings& settings, std::size_t other) {
  const Config& config = settings.config;
  PairSettings s;
  s.within = Span::from_seconds(pairs_within_s(config.devices, other));
  if (config.devices.other_cameras[other].free_running) s.patience = s.patience + s.within;
  if (const auto& calibrated = settings.others[other])
    s.second_later = Span::from_seconds(calibrated->time_offset_s - config.estimator.extrinsics.time_offset_s);
  if (settings.is_flown) {
    s.width = settings.camera.width;
    s.height = settings.camera.height;
  }
  const ThreadSettings thread = settings_of(FlightThread::kCapture, config.realtime);
  s.priority = thread.priority;
  s.cpu = thread.cpu;
  s.number = other + 1;
  return s;
}

Status add_camera(const LiveSettings& settings, LiveDevices& devices) {
  if (settings.config.devices.camera.device.empty())
    return missing(settings, "camera.device is not set",
                   "the camera's path, name or bus (epiline devices lists cameras)");
  auto camera = v4l2_settings(settings);
  if (!camera) return camera.error();
  constexpr int kForTracking = 4;
  devices.images_to_log = std::clamp(camera->buffers - kForTracking, 0, 4);
  auto v4l2 = std::make_unique<V4l2Camera>(*camera);
  V4l2Camera* const first = v4l2.get();
  devices.v4l2 = first;
  devices.records.emplace_back([first] { return record_of("camera", *first); });
  devices.turns = [first](double rad_s) { first->set_turn_rate(rad_s); };
  const DevicesConfig& d = settings.config.devices;
  const auto halves = static_cast<SideBySideHalves>(d.camera.side_by_side);
  if (halves == SideBySideHalves::kNone)
    devices.camera = std::move(v4l2);
  else
    devices.camera = std::make_unique<SideBySide>(std::move(v4l2), halves == SideBySideHalves::kRightFirst);
  for (std::size_t other = halves == SideBySideHalves::kNone ? 0 : 1; other + 1 < camera_count(d); ++other) {
    auto pair =
        std::make_unique<CameraPair>(std::move(devices.camera), other_camera(settings, other, *camera, *first, devices),
                                     pair_settings(settings, other));
    devices.records.emplace_back([p = pair.get(), name = fmt::format("{} paired", kOtherCameraNames[other])] {
      return device_record(name.c_str(), kPairCounters, p->counts(), std::nullopt);
    });
    devices.camera = std::move(pair);
  }
  return Done{};
}

/// Null if the configuration names no flight controller.
mavlink::MavlinkLink* add_link(const DevicesConfig& d, bool takes_imu, LiveDevices& devices) {
  const MavlinkConfig& m = d.mavlink;
  const std::string& where = m.serial.empty() ? m.udp : m.serial;
  if (where.empty()) return nullptr;
  auto link =
      std::make_unique<mavlink::MavlinkLink>(m, R_VB_of(d.body), takes_imu ? std::optional(d.imu) : std::nullopt);
  mavlink::MavlinkLink* const l = link.get();
  const std::string name = "mavlink " + where;
  devices.outputs.push_back(
      {std::move(link), [l, name] { return record_of(*l, name); }, name, [l] { return l->state().is_open; },
       [l] { return mavlink::sentence_of(l->state().refusal); }, [l, m] { return notes_of(l->state(), m); }});
  devices.records.emplace_back([l, m] { return device_of(*l, m); });
  return l;
}

void add_can(const DevicesConfig& d, LiveDevices& devices) {
  if (d.can.interface.empty()) return;
  auto can = std::make_unique<CanOutput>(d.can, R_VB_of(d.body));
  const CanOutput* const c = can.get();
  const std::string name = "can " + d.can.interface;
  devices.outputs.push_back({std::move(can), [c, name] { return record_of(*c, name); }, name,
                             [c] { return c->bus() != BusState::kLost && c->bus() != BusState::kOff; }});
  devices.records.emplace_back([c] { return device_of(*c); });
}

void add_dds(const DevicesConfig& d, LiveDevices& devices) {
  if (!d.dds.publish) return;
  auto dds = std::make_unique<DdsOutput>(DdsOutput::Times::kOfDay);
  DdsOutput* const o = dds.get();
  const auto record = [o] { return OutputRecord{"dds", o->sent(), o->not_sent(), 0, o->latency()}; };
  devices.outputs.push_back({.sink = std::move(dds), .record = record, .name = "dds", .is_open = {}, .observer = o});
}

void add_wheel(const DevicesConfig& d, LiveDevices& devices) {
  if (d.wheel.interface.empty()) return;
  take(std::make_unique<CanWheelSource>(d.wheel), devices.wheel, devices);
}

constexpr const char* kPortOfController = "its port in mavlink.serial or mavlink.udp";

Status add_height(const LiveSettings& settings, mavlink::MavlinkLink* link, LiveDevices& devices) {
  const HeightConfig& h = settings.config.devices.height;
  const auto origin = static_cast<HeightOrigin>(h.source);
  if (origin == HeightOrigin::kNone) return Done{};
  if (origin == HeightOrigin::kIio) {
    take(std::make_unique<IioPressure>(IioPressure::Settings{.device = h.device, .air_deg = h.air_deg}), devices.height,
         devices);
    return Done{};
  }
  if (link == nullptr)
    return missing(settings, "height.source = \"mavlink\" without a flight controller", kPortOfController);
  const HeightModels& models = settings.config.estimator.heights;
  link->want_heights({models[0].use, models[1].use}, h.air_deg);
  take(std::make_unique<MavlinkHeight>(*link), devices.height, devices);
  return Done{};
}

Status add_imu(const LiveSettings& settings, mavlink::MavlinkLink* link, LiveDevices& devices) {
  const DevicesConfig& d = settings.config.devices;
  const auto driver = static_cast<ImuDriver>(d.imu.driver);
  if (driver == ImuDriver::kMavlink) {
    if (link == nullptr)
      return missing(settings, "imu.driver = \"mavlink\" without a flight controller", kPortOfController);
    if (!R_VB_of(d.body).isIdentity())
      return missing(settings, "angles in [body] with imu.driver = \"mavlink\"",
                     "angles of 0: a flight controller sends its samples in the vehicle's axes");
    take(std::make_unique<MavlinkImu>(*link), devices.imu, devices);
    return Done{};
  }
  if (d.imu.device.empty())
    return missing(settings, "imu.device is not set", "the IMU's name or path, or imu.driver = \"mavlink\"");
  if (driver == ImuDriver::kIio) {
    take(std::make_unique<IioImu>(d.imu), devices.imu, devices);
  } else {
    take(make_spi_imu(d.imu), devices.imu, devices);
  }
  return Done{};
}

}  // namespace

MadeDevices make_each_device(const LiveSettings& settings, LiveDevices given) {
  MadeDevices made{std::move(given), Done{}, Done{}, Done{}};
  LiveDevices& devices = made.devices;
  if (!devices.camera) made.camera = add_camera(settings, devices);
  const DevicesConfig& d = settings.config.devices;
  const bool imu_given = devices.imu != nullptr;
  mavlink::MavlinkLink* const link =
      add_link(d, !imu_given && static_cast<ImuDriver>(d.imu.driver) == ImuDriver::kMavlink, devices);
  add_can(d, devices);
  add_dds(d, devices);
  add_wheel(d, devices);
  made.height = add_height(settings, link, devices);
  if (!imu_given) made.imu = add_imu(settings, link, devices);
  return made;
}

Result<LiveDevices> make_devices(const LiveSettings& settings, LiveDevices devices) {
  MadeDevices made = make_each_device(settings, std::move(devices));
  if (!made.camera) return made.camera.error();
  if (!made.imu) return made.imu.error();
  if (!made.height) return made.height.error();
  return std::move(made.devices);
}

Result<LiveDevices> make_sensors(const LiveSettings& settings) {
  LiveDevices devices;
  if (const Status s = add_camera(settings, devices); !s) return s.error();
  const DevicesConfig& d = settings.config.devices;
  const bool over_link = static_cast<ImuDriver>(d.imu.driver) == ImuDriver::kMavlink;
  mavlink::MavlinkLink* const link = over_link ? add_link(d, true, devices) : nullptr;
  if (const Status s = add_imu(settings, link, devices); !s) return s.error();
  return devices;
}

}  // namespace epiline
