#pragma once
// From the configuration to devices behind their ports.
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "drivers/study/report/flight_record.h"
#include "pipeline/config/calibration.h"
#include "pipeline/config/config.h"
#include "platform/ports/ports.h"

namespace epiline {

/// A live flight's settings, whole: configuration and calibration files read and laid over one another.
struct LiveSettings {
  Config config;
  CameraParameters camera;
  std::string source;  ///< the configuration file, for errors
};
/// Precedence: `set` (as ConfigFile::set() takes it), configuration file, calibration files, defaults. Fails if and
/// only if one of them is wrong, or no calibration of the camera is named.
Result<LiveSettings> read_live_settings(const std::filesystem::path& config_file,
                                        const std::vector<std::string>& set = {});

/// Somebody who gets the odometry, and what he says of it afterwards.
struct LiveOutput {
  std::unique_ptr<OdometrySink> sink;
  std::function<OutputRecord()> record;  ///< after close()
  std::string name;                      ///< its kind, a blank, where it goes
  std::function<bool()> is_open;         ///< false: the line is lost; any thread. Empty: it cannot be lost
};

/// None is open yet.
struct LiveDevices {
  std::unique_ptr<CameraSource> camera;
  std::unique_ptr<ImuSource> imu;
  std::unique_ptr<WheelSource> wheel;  ///< null: none
  std::vector<LiveOutput> outputs;
  std::vector<std::function<DeviceRecord()>> records;  ///< what the drivers counted, from any thread
  int images_to_log = 0;                               ///< RealtimeSettings
  /// Told how fast the body turns, rad/s, by the log thread: a camera limits its exposure by it. May be empty.
  std::function<void(double)> turns;
};
/// The configured devices, and why camera or IMU is not among them.
struct MadeDevices {
  LiveDevices devices;
  Status camera, imu;
};
/// A camera or an IMU that `devices` has already takes the place of the configuration's. Camera or IMU fail if and only
/// if the configuration names none, or something that was not built in; the others are made all the same.
MadeDevices make_each_device(const LiveSettings& settings, LiveDevices devices = {});
/// All of them. Fails where camera or IMU fail.
Result<LiveDevices> make_devices(const LiveSettings& settings, LiveDevices devices = {});

}  // namespace epiline
