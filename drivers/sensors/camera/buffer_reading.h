#pragma once
// How fast the program reads a driver's buffer. On ARM many receivers give memory that the processor does not cache:
// reading it is 10 to 50 times slower, and an image that is tracked is read several times.
#include "drivers/sensors/camera/v4l2_device.h"
#include "platform/linux/system_calls.h"
#include "platform/time/clock.h"

namespace epiline {

/// Times of reading one image once, measured when the camera is opened. 0: not measured, because the image is converted
/// or copied anyway.
struct BufferReading {
  Span in_place;  ///< in the driver's buffer
  Span ordinary;  ///< in memory of the program's own

  /// Copying it once is faster: an image is read about three times, so from twice the time on.
  bool is_slow() const noexcept { return in_place.ns > 2 * ordinary.ns; }
};

/// Asks the device for a buffer, of images of this format, and gives it back. Takes memory.
DeviceTrouble measure_reading(V4l2Device& device, SystemCalls& system, const DeviceFormat& format,
                              BufferReading& reading);

}  // namespace epiline
