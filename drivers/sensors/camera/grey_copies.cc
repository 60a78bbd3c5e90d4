#include "drivers/sensors/camera/grey_copies.h"

#include <linux/dma-buf.h>

#include <algorithm>

namespace epiline {

void GreyCopies::set_format(const DeviceFormat& format) {
  if (is_jpeg(format)) jpeg_ = std::make_unique<JpegDecoder>(format.width, format.height);
}

bool GreyCopies::copy(const DeviceFormat& format, const DriverMemory& from, std::size_t used, std::uint8_t* to,
                      int stride) const noexcept {
  if (jpeg_) return jpeg_->decode(from.data, std::min(used, from.length), to, stride);
  announce_reading(from, true);
  to_grey(format.format, from.data, format.stride, format.width, format.height, to, stride);
  announce_reading(from, false);
  return true;
}

/// Where caches must be brought up to date for reading, the kernel does it then.
void GreyCopies::announce_reading(const DriverMemory& buffer, bool begins) const noexcept {
  if (buffer.file < 0) return;
  dma_buf_sync sync{};
  sync.flags = DMA_BUF_SYNC_READ;
  sync.flags |= begins ? DMA_BUF_SYNC_START : DMA_BUF_SYNC_END;
  call_device(system_, buffer.file, DMA_BUF_IOCTL_SYNC, &sync);
}

}  // namespace epiline
