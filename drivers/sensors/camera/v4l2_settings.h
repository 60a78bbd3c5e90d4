#pragma once
// Settings of a V4L2 camera, from the configuration.
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "drivers/sensors/camera/mid_exposure.h"
#include "drivers/sensors/camera/pixel_format.h"
#include "drivers/sensors/gpio/gpio_line.h"
#include "pipeline/config/devices.h"
#include "platform/error/result.h"
#include "platform/time/clock.h"

namespace epiline {

using CameraControl = NamedValue;  ///< the name as `v4l2-ctl --list-ctrls` writes it: exposure_time_absolute

/// All formats, those first that cost least.
std::vector<PixelFormat> all_by_cost();

struct V4l2Settings {
  /// A path (/dev/video0, /dev/v4l/by-id/...), or the name or bus of a device as `v4l2-ctl --list-devices` shows them.
  std::string device;
  /// In a media graph (CSI cameras of boards): part of the sensor's name; empty: the only one that leads to the device.
  std::string sensor{};
  /// Of the grey image; of a mosaic of colours the camera gives twice that. 0: as the device is set.
  int width = 0, height = 0;
  double rate_hz = 0;  ///< 0: as the device is set
  /// The first of them that the device gives at that size and rate is taken. Those that are grey in place are not
  /// copied.
  std::vector<PixelFormat> formats = all_by_cost();
  int buffers = 8;  ///< 2 to 16; the tracker and the ring before it hold up to 6 of them when there is no time
  std::vector<CameraControl> controls{};  ///< set in this order, then read back

  Shutter shutter = Shutter::kGlobal;
  Span readout{};  ///< from the first row's arrival to the last one's
  /// The exposure time: `exposure` if there is no control that tells it, else that control's value times `exposure`.
  std::string exposure_control{};
  Span exposure{};
  ExposureConfig control_of_exposure{};
  double focal_px = 0;                      ///< pixels per radian, for the limit against blur; 0: unknown
  std::optional<StampPoint> stamp_point{};  ///< overrides what the driver declares
  /// Timestamps are monotonic although the driver does not declare it, as with v4l2loopback, which copies its writer's
  /// timestamps.
  bool trust_stamps = false;
  /// Timestamps by the camera's own clock, of its metadata (USB cameras). `clock_hz`: its ticks per second; 0: as its
  /// descriptors tell.
  bool uses_own_clock = false;
  std::uint32_t clock_hz = 0;
  /// A GPIO line with an edge at the start of each exposure (see GpioLine), which then gives the timestamps.
  std::string stamp_line{};
  Edge stamp_edge = Edge::kRising;

  Span stamp_age_most = Span::from_milliseconds(1'000);  ///< a timestamp farther from now is not on the monotonic clock
  Span silence_most = Span::from_milliseconds(2'000);  ///< reopen the device after this time without an image; 0: never
};

/// Of sections [camera] and [exposure]; says which entry makes no sense.
Result<V4l2Settings> v4l2_settings_of(const CameraConfig& config);

}  // namespace epiline
