#pragma once
// A simulated IMU behind real kernel drivers: a HID sensor hub on /dev/uhid, which hid-sensor-gyro-3d and
// hid-sensor-accel-3d turn into two IIO devices, gyro_3d and accel_3d. Needs those modules and root.
#include <array>
#include <atomic>
#include <cstdint>
#include <string>
#include <thread>

#include "platform/error/result.h"
#include "platform/time/clock.h"

namespace epiline {

/// Any thread may send. One thread calls plug_in() and unplug().
class UhidImu {
 public:
  UhidImu() = default;
  ~UhidImu();
  UhidImu(const UhidImu&) = delete;
  UhidImu& operator=(const UhidImu&) = delete;

  /// Returns when both IIO devices and their device files exist. Fails if they do not appear within 30 s.
  Status plug_in();
  /// Removes the IIO devices, even while a program reads them.
  void unplug() noexcept;

  /// `iio:deviceN` of each; valid while plugged in.
  const std::string& gyroscope_device() const noexcept { return sensors_[0].device; }
  const std::string& accelerometer_device() const noexcept { return sensors_[1].device; }

  /// True if a reader has switched both sensors on. Samples sent before that are lost. The kernel switches a sensor off
  /// some seconds after its last reader has closed it.
  bool is_on() const noexcept { return sensors_[0].is_on && sensors_[1].is_on; }
  /// The sampling interval that the kernel requested, in ms; 0: none yet.
  int interval_ms() const noexcept { return sensors_[0].interval_ms; }

  /// Sends one sample, in rad/s or m/s^2, rounded to 10^-6. `time`: timestamp of the hub's own clock, which IIO passes
  /// on unchanged; 0: none, so that the kernel stamps the arrival. False: not plugged in.
  bool send_gyroscope(DeviceStamp time, const std::array<double, 3>& rad_s) noexcept { return send(0, time, rad_s); }
  bool send_accelerometer(DeviceStamp time, const std::array<double, 3>& m_s2) noexcept { return send(1, time, m_s2); }

 private:
  struct Sensor {
    std::string device;
    std::atomic<int> interval_ms{0};
    std::atomic<bool> is_on{false};
    std::array<std::uint8_t, 6>
        feature{};  ///< while plugged in, the answering thread's: interval, reporting state, power state
  };

  Status open();
  Status create();
  bool send(std::size_t sensor, DeviceStamp time, const std::array<double, 3>& axes) noexcept;
  void answer();
  bool find_devices();

  int fd_ = -1;         ///< stays open while unplugged: senders may not know yet
  std::string unique_;  ///< by which sysfs tells this hub from others
  std::array<Sensor, 2> sensors_;
  std::atomic<bool> ends_{false};
  std::thread answering_;
};

}  // namespace epiline
