#pragma once
// Grey copies of a driver's buffers: of images in colours, packed or compressed, and where reading in place is slow.
#include <cstddef>
#include <cstdint>
#include <memory>

#include "drivers/sensors/camera/jpeg_decoder.h"
#include "drivers/sensors/camera/v4l2_device.h"
#include "platform/linux/system_calls.h"

namespace epiline {

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
  bool can_copy(const DeviceFormat& format) const noexcept { return is_jpeg(format) == (jpeg_ != nullptr); }
  void clear() noexcept { jpeg_.reset(); }

  /// Of `format`, as the device was set. `used`: bytes of the image. False: no whole JPEG.
  bool copy(const DeviceFormat& format, const DriverMemory& from, std::size_t used, std::uint8_t* to,
            int stride) const noexcept;

 private:
  static bool is_jpeg(const DeviceFormat& format) noexcept { return format.format == PixelFormat::kMjpeg; }
  void announce_reading(const DriverMemory& buffer, bool begins) const noexcept;

  SystemCalls& system_;
  std::unique_ptr<JpegDecoder> jpeg_;  ///< of MJPEG
};

}  // namespace epiline
