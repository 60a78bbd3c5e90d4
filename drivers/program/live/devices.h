#pragma once
// Creates the devices of a live flight from the configuration.
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "drivers/study/report/flight_record.h"
#include "pipeline/config/calibration.h"
#include "pipeline/config/config.h"
#include "pipeline/realtime/flight_observer.h"
#include "platform/ports/ports.h"

namespace epiline {

class V4l2Camera;

/// All settings of a live flight, from configuration and calibration files.
struct LiveSettings {
  Config config;
  CameraParameters camera;                                           ///< width 0: not calibrated
  std::array<std::optional<CameraCalibration>, kMostOthers> others;  ///< cameras 1 to 3, if there and calibrated
  ImuCorrection imu_correction;
  std::string source;    ///< the configuration file, for errors
  bool is_flown = true;  ///< false: of a silent first camera of several, no black images are made
  bool has_camera_calibration() const { return camera.width > 0; }
};
/// Whether the camera must be calibrated: a flight needs it, a recording does not.
enum class CalibrationNeed : std::uint8_t { kRequired, kIfGiven };
/// Reads all settings. Precedence: `set` (as ConfigFile::set() takes it), configuration file, calibration files,
/// defaults. Fails if and only if one of them is wrong, or camera.calibration is required and not set.
Result<LiveSettings> read_live_settings(const std::filesystem::path& config_file,
                                        const std::vector<std::string>& set = {},
                                        CalibrationNeed need = CalibrationNeed::kRequired);

/// A receiver of the odometry, and its counters.
struct LiveOutput {
  std::unique_ptr<OdometrySink> sink;
  std::function<OutputRecord()> record;  ///< after close()
  std::string name;                      ///< kind and destination, as in "mavlink /dev/ttyAMA0"
  std::function<bool()> is_open;         ///< false: the connection is lost; any thread. Empty: it cannot be lost
  std::function<const char*()> refusal = nullptr;  ///< why it is not sent as configured; "" or empty: it is sent
  /// What the receiver said of its settings, and of what it uses, a sentence each. May be empty.
  std::function<std::vector<std::string>()> notes = nullptr;
  FlightObserver* observer = nullptr;  ///< the sink, if it takes what the log thread hands out
};

/// The devices, not opened yet.
struct LiveDevices {
  std::unique_ptr<CameraSource> camera;
  std::unique_ptr<ImuSource> imu;
  std::unique_ptr<WheelSource> wheel;    ///< null: none
  std::unique_ptr<HeightSource> height;  ///< null: none
  std::vector<LiveOutput> outputs;
  std::vector<std::function<DeviceRecord()>> records;  ///< the drivers' counters; any thread may call them
  int images_to_log = 0;                               ///< RealtimeSettings
  /// Receives the rotation rate of the body, rad/s, from the log thread; a camera limits its exposure with it. May be
  /// empty.
  std::function<void(double)> turns;
  const V4l2Camera* v4l2 = nullptr;  ///< the driver of the (first) camera; null: it is not of the configuration
};
/// The configured devices, and the errors of camera and IMU.
struct MadeDevices {
  LiveDevices devices;
  Status camera, imu, height;
};
/// A camera or IMU in `devices` replaces the configured one. Heights fail without a flight controller to send them.
/// Camera or IMU fail if and only if the configuration names none, or one that was not built in; the other devices are
/// created all the same.
MadeDevices make_each_device(const LiveSettings& settings, LiveDevices devices = {});
/// Creates all devices. Fails if camera, IMU or heights fail.
Result<LiveDevices> make_devices(const LiveSettings& settings, LiveDevices devices = {});
/// Creates camera and IMU alone. The only output is the link that a flight controller's IMU comes over. Fails like
/// make_devices().
Result<LiveDevices> make_sensors(const LiveSettings& settings);

}  // namespace epiline
