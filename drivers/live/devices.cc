#include "drivers/live/devices.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <numbers>

#include "drivers/camera/v4l2_camera.h"
#include "drivers/output/can/can_output.h"
#include "drivers/output/mavlink/link.h"

namespace epiline {

namespace {

Error missing(const LiveSettings& settings, const char* found, const char* expected) {
  return {ErrorKind::kUsage, settings.source, 0, found, expected};
}

Result<V4l2Settings> v4l2_settings(const LiveSettings& settings) {
  CameraConfig c = settings.config.devices.camera;
  if (c.width == 0) c.width = settings.camera.width;
  if (c.height == 0) c.height = settings.camera.height;
  if (c.width != settings.camera.width || c.height != settings.camera.height) {
    return Error{
        ErrorKind::kUsage, settings.source, 0, fmt::format("camera.width = {}, camera.height = {}", c.width, c.height),
        fmt::format("{} x {}, the size the camera was calibrated with", settings.camera.width, settings.camera.height)};
  }
  auto s = v4l2_settings_of(c);
  if (!s) {
    const Error& e = s.error();
    return Error{e.kind, settings.source, 0, e.file + ": " + e.found, e.expected};
  }
  s->focal_px = settings.config.estimator.extrinsics.focal_px;
  return s;
}

DeviceRecord record_of(const V4l2Camera& camera) {
  const CameraCounts c = camera.counts();
  return {"camera",
          {{"images", c.frames},
           {"lost", c.lost},
           {"damaged", c.damaged},
           {"incomplete", c.incomplete},
           {"bad_stamps", c.bad_stamps},
           {"no_slot", c.no_slot},
           {"overwritten", c.overwritten},
           {"disconnected", c.disconnected},
           {"retries", c.retries}},
          std::nullopt};
}

OutputRecord record_of(const mavlink::MavlinkLink& link, const std::string& name) {
  const mavlink::LinkCounts c = link.counts();
  return {"mavlink " + name, c.odometry, c.dropped, c.disconnected, link.latency()};
}

DeviceRecord device_of(const mavlink::MavlinkLink& link) {
  const mavlink::LinkState s = link.state();
  const mavlink::LinkCounts& c = s.counts;
  return {"mavlink",
          {{"packets", c.packets},
           {"bad_checksums", c.bad_checksums},
           {"skipped_bytes", c.skipped_bytes},
           {"strangers", c.strangers},
           {"refused_questions", c.refused_questions},
           {"refused_answers", c.refused_answers},
           {"timesync_answers", c.timesync_answers},
           {"disconnected", c.disconnected},
           {"retries", c.retries},
           {"write_errors", c.write_errors},
           {"heap_calls", s.costs.heap_calls},
           {"lock_calls", s.costs.lock_calls}},
          s.clock};
}

OutputRecord record_of(const CanOutput& can, const std::string& interface) {
  const CanOutputCounts c = can.counts();
  return {"can " + interface, c.epochs, c.stale + c.frames_dropped, c.disconnected, can.image_latency()};
}

}  // namespace

Mat3 R_VB_of(const BodyConfig& body) {
  constexpr double kDegree = std::numbers::pi / 180;
  return (Eigen::AngleAxisd(body.yaw_deg * kDegree, Vec3::UnitZ()) *
          Eigen::AngleAxisd(body.pitch_deg * kDegree, Vec3::UnitY()) *
          Eigen::AngleAxisd(body.roll_deg * kDegree, Vec3::UnitX()))
      .toRotationMatrix();
}

Result<LiveSettings> read_live_settings(const std::filesystem::path& config_file) {
  const auto file = ConfigFile::read(config_file);
  if (!file) return file.error();
  LiveSettings settings;
  settings.source = config_file.string();
  Config& config = settings.config;
  file->apply(config);  // for the names of calibration files
  if (config.camera_calibration.empty()) {
    return missing(settings, "no camera.calibration",
                   "a file with the camera's lens and place, as Kalibr writes it (camchain-imucam.yaml)");
  }
  const auto camera = read_camera_calibration(config.camera_calibration, "cam0");
  if (!camera) return camera.error();
  settings.camera = camera->parameters;
  config.estimator.extrinsics = {camera->R_BC, camera->p_BC, Camera(camera->parameters).focal_px(),
                                 camera->time_offset_s};
  if (!config.imu_calibration.empty()) {
    const auto imu = read_imu_calibration(config.imu_calibration);
    if (!imu) return imu.error();
    EstimatorConfig& e = config.estimator;
    e.imu = imu->noise;
    if (imu->saturation_gyroscope_rad_s) e.saturation_gyroscope_rad_s = *imu->saturation_gyroscope_rad_s;
    if (imu->saturation_accelerometer_m_s2) e.saturation_accelerometer_m_s2 = *imu->saturation_accelerometer_m_s2;
  }
  file->apply(config);  // the file wins
  return settings;
}

namespace {

Status add_camera(const LiveSettings& settings, LiveDevices& devices) {
  if (settings.config.devices.camera.device.empty())
    return missing(settings, "no camera.device", "the camera's path, name or bus");
  auto camera = v4l2_settings(settings);
  if (!camera) return camera.error();
  constexpr int kForTracking = 4;
  devices.images_to_log = std::clamp(camera->buffers - kForTracking, 0, 4);
  auto v4l2 = std::make_unique<V4l2Camera>(std::move(*camera));
  devices.records.emplace_back([c = v4l2.get()] { return record_of(*c); });
  devices.camera = std::move(v4l2);
  return Done{};
}

Status add_imu(const LiveSettings& settings, LiveDevices& /*devices*/) {
  const ImuDeviceConfig& imu = settings.config.devices.imu;
  if (imu.device.empty() && static_cast<ImuDriver>(imu.driver) != ImuDriver::kMavlink)
    return missing(settings, "no imu.device", "the IMU's name or path, or imu.driver = \"mavlink\"");
  return missing(settings, "an IMU driver that this program was built without", "another imu.driver");
}

void add_outputs(const DevicesConfig& d, LiveDevices& devices) {
  if (const MavlinkConfig& m = d.mavlink; !m.serial.empty() || !m.udp.empty()) {
    auto link = std::make_unique<mavlink::MavlinkLink>(m, R_VB_of(d.body));
    const mavlink::MavlinkLink* const l = link.get();
    const std::string name = m.serial.empty() ? m.udp : m.serial;
    devices.outputs.push_back({std::move(link), [l, name] { return record_of(*l, name); }});
    devices.records.emplace_back([l] { return device_of(*l); });
  }
  if (const std::string& interface = d.can.interface; !interface.empty()) {
    auto can = std::make_unique<CanOutput>(d.can, R_VB_of(d.body));
    const CanOutput* const c = can.get();
    devices.outputs.push_back({std::move(can), [c, interface] { return record_of(*c, interface); }});
  }
}

}  // namespace

Result<LiveDevices> make_devices(const LiveSettings& settings, LiveDevices devices) {
  if (!devices.camera) {
    if (const Status s = add_camera(settings, devices); !s) return s.error();
  }
  if (!devices.imu) {
    if (const Status s = add_imu(settings, devices); !s) return s.error();
  }
  add_outputs(settings.config.devices, devices);
  return devices;
}

}  // namespace epiline
