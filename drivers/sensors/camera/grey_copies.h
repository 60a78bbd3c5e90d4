#pragma once
// Grey copies of a driver's buffers: of images in colours, packed or compressed, and where reading in place is slow. On
// ARM many receivers give memory that the processor does not cache: reading it is 10 to 50 times slower, and an image
// that is tracked is read several times.
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "drivers/sensors/camera/jpeg_decoder.h"
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

/// A driver's buffer, in our memory.
struct DriverMemory {
  std::uint8_t* data = nullptr;
  std::size_t length = 0;
  int file = -1;  ///< of the buffer, where reading it must be announced; else -1
};

/// One thread. After set_format() there is no heap call.
class GreyCopies {
 public:
  explicit GreyCopies(SystemCalls& system) noexcept : system_(system) {}

  /// Takes what decoding it needs.
  void set_format(const DeviceFormat& format);
  /// A device that is back gives what can be copied without more memory.
  bool can_copy(const DeviceFormat& format) const noexcept {
    return is_jpeg(format) == (jpeg_ != nullptr) && bytes_at_once(format) <= rows_.size();
  }
  void clear() noexcept {
    jpeg_.reset();
    rows_ = {};
  }

  /// Of `format`, as the device was set. `used`: bytes of the image. False: no whole JPEG.
  bool copy(const DeviceFormat& format, const DriverMemory& from, std::size_t used, std::uint8_t* to,
            int stride) const noexcept;

 private:
  static bool is_jpeg(const DeviceFormat& format) noexcept { return format.format == PixelFormat::kMjpeg; }
  /// Of the driver's memory, for one row of grey.
  static std::size_t bytes_at_once(const DeviceFormat& format) noexcept {
    if (is_grey_in_place(format.format)) return 0;
    return (is_mosaic(format.format) ? 2 : 1) * row_bytes(format.format, format.width);
  }
  void convert(const DeviceFormat& format, const std::uint8_t* from, std::uint8_t* to, int stride) const noexcept;
  void announce_reading(const DriverMemory& buffer, bool begins) const noexcept;

  SystemCalls& system_;
  std::unique_ptr<JpegDecoder> jpeg_;       ///< of MJPEG
  mutable std::vector<std::uint8_t> rows_;  ///< of the driver's image, as they were: one, of a mosaic two
};

}  // namespace epiline
