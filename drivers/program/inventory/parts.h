#pragma once
// What is plugged into a computer, in detail and without a configuration: `epiline devices`. docs/devices.md
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "drivers/sensors/imu/spi_identity.h"
#include "platform/linux/system_calls.h"

namespace epiline {

/// An entry of the configuration that selects a part.
struct PartSetting {
  std::string key, value;  ///< as in camera.device = "HD USB Camera"
};

struct Part {
  std::string path;  ///< or the name of a network interface
  std::string name;  ///< as its driver calls it; may be empty
  std::vector<PartSetting> settings;
  std::string trouble;  ///< why it cannot be used as it is, and what to do; empty: nothing is known to be wrong
};

/// One image size, or a range of sizes, as camera.width and camera.height.
struct CameraSize {
  unsigned width = 0, height = 0, width_most = 0, height_most = 0;
  std::vector<double> rates_hz;       ///< empty: the driver does not list them
  bool has_any_rate_between = false;  ///< rates_hz holds the lowest and the highest
  bool is_range() const { return width_most > width || height_most > height; }
};

struct CameraFormat {
  std::string name;        ///< four letters, as camera.format
  bool is_read = false;    ///< epiline reads it
  bool is_mosaic = false;  ///< of colours: the camera's image has twice the sizes below
  std::vector<CameraSize> sizes;
};

/// A control of exposure time or gain.
struct CameraControlRange {
  std::string name;  ///< as in camera.controls
  std::int64_t least = 0, most = 0, step = 0, standard = 0;
};

struct CameraPart : Part {
  std::string bus, driver;
  std::string lasting_path;  ///< below /dev/v4l, which stays whatever is plugged in first; empty: none
  std::vector<CameraFormat> formats;
  std::vector<CameraControlRange> controls;
};

/// An IIO device with a gyroscope, an accelerometer or both.
struct ImuPart : Part {
  bool has_gyroscope = false, has_accelerometer = false;
  double rate_hz = 0;            ///< as it is set; 0: the driver does not say
  std::vector<double> rates_hz;  ///< empty: the driver does not list them
};

/// A chip select of an SPI bus. Only probe() fills in more than its path.
struct ChipPart : Part {
  SpiChip chip = SpiChip::kUnknown;
  std::string ready_line = {};  ///< on which its edges are, as imu.ready_line; empty: not found
};

struct SerialPart : Part {
  std::string vendor, product;  ///< four hexadecimal digits each, of USB; may be empty
  std::string autopilot;        ///< a flight controller by its USB vendor or maker, or heard by probe(); empty: unknown
  int baud = 0, system = 0;     ///< of the heartbeat that probe() heard; 0: none
};

struct CanPart : Part {
  bool is_up = false, has_fd = false;
  std::string state;                            ///< of the controller; of a virtual bus its operational state
  std::uint32_t bitrate = 0, data_bitrate = 0;  ///< bit/s; 0: not set, or a virtual bus
};

struct GpioPart : Part {
  unsigned lines = 0;
};

struct Parts {
  std::vector<CameraPart> cameras;  ///< nodes that give images; those of metadata and outputs are left out
  std::vector<ImuPart> imus;
  std::vector<ChipPart> spi;  ///< each may be an IMU
  std::vector<SerialPart> serial;
  std::vector<CanPart> can;
  std::vector<GpioPart> gpio;
};

/// Changes nothing, and opens no serial port, because that resets some boards. `root`: as list_devices().
Parts find_parts(const std::filesystem::path& root = "/", SystemCalls& system = SystemCalls::of_this_computer());

/// "320x180 (30, 60 Hz), 16x16 to 4056x3040 (1 to 120 Hz)"
std::string to_text(const std::vector<CameraSize>& sizes);
/// For people: a few lines for each part.
std::string to_text(const Parts& parts);

}  // namespace epiline
