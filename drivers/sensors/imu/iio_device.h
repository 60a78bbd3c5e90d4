#pragma once
// One device of Linux' industrial I/O (IIO): found, set up, read and put back as it was. No heap, no exceptions.
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/sensors/imu/iio_attributes.h"
#include "drivers/sensors/imu/iio_scan.h"
#include "platform/error/device_trouble.h"

namespace epiline {

/// Where the kernel shows its devices. Tests may make a place of their own.
struct IioRoots {
  const char* attributes = "/sys/bus/iio/devices";
  const char* files = "/dev";
};

/// What is asked of a device.
struct IioRequest {
  const char* device = "";  ///< its name or label, iio:deviceN, or a path of it in /dev or /sys
  bool gyroscope = false, accelerometer = false;
  double rate_hz = 0;
  const char* trigger = "";  ///< name of a trigger; empty: the one that is set, or the device's own
};

/// One reading, in rad/s and m/s^2, in the axes of the board (mount matrix applied). Axes not asked for are 0.
struct IioReading {
  std::int64_t stamp_ns = 0;  ///< as the device gives it
  std::array<double, 3> angular_velocity_rad_s{}, specific_force_m_s2{};
};

class IioDevice {
 public:
  static constexpr std::size_t kMostReadings = 64;  ///< that one read() gives

  IioDevice() = default;
  IioDevice(const IioDevice&) = delete;
  IioDevice& operator=(const IioDevice&) = delete;
  ~IioDevice() { close(); }

  /// Finds the device, takes it for us alone, sets it up and lets it run.
  DeviceTrouble open(const IioRoots& roots, const IioRequest& request) noexcept;
  /// Stops it; the attributes become what they were.
  void close() noexcept;

  bool is_open() const noexcept { return fd_ >= 0; }
  int fd() const noexcept { return fd_; }
  const char* name() const noexcept { return name_.c_str(); }
  /// The HID sensor hub it belongs to, by its place in sysfs; empty: to none.
  ShortText<512> hub() const noexcept;
  double rate_hz() const noexcept { return rate_hz_; }  ///< as the device says; 0: it does not

  /// The oldest readings, as many as there are; does not wait. 0; EAGAIN: none; else the device is lost.
  int read(std::span<IioReading> readings, std::size_t& count) noexcept;

 private:
  struct Sensor {
    std::array<double, 3> offset{}, scale{1, 1, 1};
    std::array<double, 9> mount{1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< row by row
  };

  DeviceTrouble find(const IioRoots& roots, const char* wanted) noexcept;
  DeviceTrouble take(const IioRoots& roots) noexcept;
  DeviceTrouble choose_channels(const IioRequest& request) noexcept;
  DeviceTrouble choose_trigger(const IioRoots& roots, const char* wanted) noexcept;
  DeviceTrouble set_rate(double wanted_hz) noexcept;
  DeviceTrouble set_buffer() noexcept;
  DeviceTrouble read_layout() noexcept;
  DeviceTrouble read_sensor(const char* type, Sensor& sensor) noexcept;
  DeviceTrouble write(const char* name, const char* value) noexcept;

  IioAttributes attributes_, trigger_;
  ShortText<32> folder_name_;  ///< iio:deviceN
  ShortText<64> name_;
  int fd_ = -1;
  double rate_hz_ = 0;
  IioScanLayout layout_;
  std::array<Sensor, 2> sensors_{};
  std::array<std::uint8_t, 2 * IioScanLayout::kMostBytes> bytes_{};
};

/// "1, 0, 0; 0, 1, 0; 0, 0, 1", row by row. False: not nine finite numbers, or they are no rotation or reflection.
bool parse_mount_matrix(const char* text, std::array<double, 9>& matrix) noexcept;

}  // namespace epiline
