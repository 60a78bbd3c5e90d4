#pragma once
// Configuration of devices: plain data. The table in parameters.cc has the settings, with units and ranges. An empty
// device name means that there is no such device.
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/config/bus_signal.h"
#include "pipeline/config/named_value.h"
#include "platform/samples/samples.h"

namespace epiline {

/// Section [exposure]: control of a live camera's exposure. docs/camera.md.
struct ExposureConfig {
  bool automatic = false;
  double longest_ms = 10;
  double blur_px = 2;  ///< largest motion blur by rotation; 0: no limit
  std::string gain_control;
  double gain_unit = 1;   ///< gain of a value of 1 in gain_control
  int gain_scale = 0;     ///< kGainScaleNames
  double gain_most = 16;  ///< largest gain, as a factor
  double flicker_hz = 0;  ///< flicker of the lamps, twice the mains frequency; 0: none
  // Not settings: the same for every camera.
  double shortest_ms = 0.02;  ///< below it, dark noise and strobes; the control's own least value holds as well
  double brightness = 100;    ///< mean grey value to aim at in images without texture: room on both sides
  int delay_images = -1;      ///< number of images after a change that do not show it yet; -1: learn it
};
inline constexpr const char* kGainScaleNames[] = {"linear", "decibel"};

/// Section [camera]. The fields of V4l2Settings say more.
struct CameraConfig {
  std::string device;  ///< a path, or the name or bus that `v4l2-ctl --list-devices` shows
  std::string sensor;  ///< in a media graph: part of the sensor's name
  int width = 0, height = 0;
  double rate_hz = 0;
  std::string format;  ///< four letters, as V4L2 writes it; empty: the best the device has
  std::vector<NamedValue> controls;
  int shutter = 0;  ///< kShutterNames
  double readout_ms = 0;
  double exposure_ms = 0;  ///< exposure time, if no control gives it
  std::string exposure_control;
  double exposure_unit_ms = 0.1;  ///< of that control
  int stamp_point = 0;            ///< kStampPointNames
  bool trust_stamps = false;
  int clock = 0;        ///< kCameraClockNames
  double clock_hz = 0;  ///< ticks per second of the camera's own clock; 0: as its descriptors tell
  double silence_ms = 2000;
  std::string stamp_line;  ///< GPIO line with an edge at the start of each exposure; see GpioLine
  int stamp_edge = 0;      ///< kEdgeNames
  int side_by_side = 0;    ///< kSideBySideNames
  ExposureConfig exposure;
};
enum class SideBySideHalves : std::uint8_t { kNone, kLeftFirst, kRightFirst };
inline constexpr const char* kSideBySideNames[] = {"none", "left-first", "right-first"};
inline constexpr const char* kShutterNames[] = {"global", "rolling"};
inline constexpr const char* kStampPointNames[] = {"driver", "start-of-exposure", "end-of-frame", "first-row"};
inline constexpr const char* kCameraClockNames[] = {"driver", "device"};
inline constexpr const char* kEdgeNames[] = {"rising", "falling"};

/// A camera beside the one of [camera], of the same kind; what is not here is as there. docs/camera.md#several-cameras.
struct OtherCameraConfig {
  std::string device;         ///< empty: none, or the other half of the first one's images
  std::string sensor;         ///< in a media graph: part of the sensor's name
  std::string stamp_line;     ///< its own GPIO line; see GpioLine
  std::string calibration;    ///< empty: cam1 (cam2, cam3) of the first one's file
  bool free_running = false;  ///< it is not triggered together with the first one
  double within_ms = 0;  ///< images of both are taken together if they are no farther apart; 0: see pairs_within_s()
};
/// Their sections, and what a user reads.
inline constexpr const char* kOtherCameraSections[] = {"second_camera", "third_camera", "fourth_camera"};
inline constexpr const char* kOtherCameraNames[] = {"second camera", "third camera", "fourth camera"};

/// Section [imu]: where its readings come from.
struct ImuDeviceConfig {
  int driver = 0;      ///< kImuDriverNames
  std::string device;  ///< IIO: name or path; SPI: /dev/spidevB.C (of the BMI088: its gyroscope); MAVLink: nothing
  std::string device_accel;  ///< IIO: where the accelerometer is another device; BMI088: its second chip select
  std::string trigger;       ///< IIO: by its name; empty: the one that is set, or the device's own
  double rate_hz = 200;
  std::string ready_line;  ///< GPIO line of the data-ready edge; see GpioLine
  int ready_edge = 0;      ///< kEdgeNames
  double delay_ms = 0;     ///< delay from sampling to the timestamp: filters, transport
  int spi_hz = 0;          ///< 0: the chip's
  double gyroscope_range_deg_s = 2000, accelerometer_range_m_s2 = 157;  ///< the next larger one the chip has
};
enum class ImuDriver : std::uint8_t { kIio, kIcm42688p, kBmi088, kAdis16470, kMavlink };
inline constexpr const char* kImuDriverNames[] = {"iio", "icm42688p", "bmi088", "adis16470", "mavlink"};

/// Section [body]: mounting of the IMU in the vehicle. Rotations, first about z, then y, then x, from the vehicle's
/// axes (forward, left, up) to the IMU's.
struct BodyConfig {
  std::array<double, 3> yaw_pitch_roll_deg{};
};

/// Section [mavlink]: the link to a flight controller.
struct MavlinkConfig {
  std::string serial;      ///< device file; or
  int baud = 921'600;      ///< up to 4,000,000
  std::string udp;         ///< ADDRESS:PORT of the peer
  std::string udp_listen;  ///< ADDRESS:PORT of ours; empty: any free port of the address that reaches the peer
  int system = 1, component = 197;
  std::string signing_key_file;  ///< empty: frames are neither signed nor must they be
  double rate_hz = 40;
  int message = 0;  ///< kMavlinkMessageNames
  int frame = 0;    ///< kMavlinkFrameNames
  /// The vehicle's heading at the first pose, clockwise from true north. Negative: not known.
  double heading_deg = -1;
  /// Where on earth the local frame begins, for an ArduPilot without GPS: latitude and longitude, deg; altitude above
  /// sea level, m. Latitude and longitude 0: it is not told.
  std::array<double, 3> origin{};
  bool has_origin() const { return origin[0] != 0 || origin[1] != 0; }
};
inline constexpr const char* kMavlinkMessageNames[] = {"odometry", "vision-position"};
inline constexpr const char* kMavlinkFrameNames[] = {"local-frd", "local-ned"};

/// Section [can]: odometry on a CAN bus.
struct CanConfig {
  std::string interface;
  bool fd = true;       ///< CAN FD frames; else classic ones
  int base_id = 0x300;  ///< the first identifier; those after it are used too
  double rate_hz = 50;
};

/// Section [dds]: odometry for nodes of ROS 2.
struct DdsConfig {
  bool publish = false;
};

/// Section [wheel]: a vehicle's speed in frames of a CAN bus.
struct WheelConfig {
  std::string interface;
  BusSignal signal;                    ///< its value is in m/s
  double delay_ms = 0;                 ///< from the instant of a speed to its frame's arrival
  std::array<double, 3> position_m{};  ///< where the speed is measured, seen from the IMU: forward, left, up
};

/// Section [height]: where a live flight's heights come from, and how the sensors sit in the vehicle.
struct HeightConfig {
  int source = 0;       ///< kHeightSourceNames
  std::string device;   ///< IIO: name or path; empty: the only barometer there is
  double air_deg = 15;  ///< temperature of the air at the ground, deg C: for heights from pressures
  std::array<double, 3> range_position_m{};  ///< the range finder, seen from the IMU: forward, left, up
  std::array<double, 2> range_tilt_deg{};    ///< of its beam from straight down: to the front, to the left
};

enum class HeightOrigin : std::uint8_t { kNone, kMavlink, kIio };
inline constexpr const char* kHeightSourceNames[] = {"none", "mavlink", "iio"};

struct DevicesConfig {
  CameraConfig camera;
  std::array<OtherCameraConfig, kMostOthers> other_cameras;
  ImuDeviceConfig imu;
  BodyConfig body;
  MavlinkConfig mavlink;
  CanConfig can;
  DdsConfig dds;
  WheelConfig wheel;
  HeightConfig height;
};

/// How far apart images of the first camera and another may be that are taken together, s: what is set; else 1 ms, or,
/// for a free-running one, half a period, beyond which another image is nearer.
inline double pairs_within_s(const DevicesConfig& devices, std::size_t other) {
  const OtherCameraConfig& c = devices.other_cameras[other];
  if (c.within_ms > 0) return 1e-3 * c.within_ms;
  constexpr double kUsualRate_hz = 30;
  const double rate_hz = devices.camera.rate_hz > 0 ? devices.camera.rate_hz : kUsualRate_hz;
  return c.free_running ? 0.5 / rate_hz : 1e-3;
}

/// 1 to 4: up to the first that is not there.
inline std::size_t camera_count(const DevicesConfig& devices) {
  std::size_t n = devices.camera.side_by_side != 0 ? 2 : 1;
  while (n <= kMostOthers && !devices.other_cameras[n - 1].device.empty()) ++n;
  return n;
}

}  // namespace epiline
