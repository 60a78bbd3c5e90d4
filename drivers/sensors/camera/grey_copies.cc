#include "drivers/sensors/camera/grey_copies.h"

#include <linux/dma-buf.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace epiline {

namespace {

// The kernel has EAGAIN answered by another call. A buffer that is handed out is ready, so that one nearly always does.
constexpr int kMostAttempts = 100;

}  // namespace

DeviceTrouble measure_reading(V4l2Device& device, SystemCalls& system, const DeviceFormat& format,
                              BufferReading& reading) {
  unsigned count = 1;
  if (const DeviceTrouble trouble = device.request_buffers(count)) return trouble;
  std::uint8_t* memory = nullptr;
  std::size_t length = 0;
  std::uint32_t ignored = 0;
  if (const DeviceTrouble trouble = device.map(0, memory, length, ignored)) return trouble;
  const std::size_t bytes = std::min(length, image_bytes(format.format, format.width, format.height, format.stride));
  const std::vector<std::uint8_t> ordinary(bytes, 1);
  reading.in_place = system.read_time(memory, bytes);
  reading.ordinary = system.read_time(ordinary.data(), bytes);
  system.unmap(memory, length);
  count = 0;
  return device.request_buffers(count);
}

void GreyCopies::set_format(const DeviceFormat& format) {
  rows_.resize(bytes_at_once(format));
  if (is_jpeg(format)) jpeg_ = std::make_unique<JpegDecoder>(format.width, format.height);
}

bool GreyCopies::copy(const DeviceFormat& format, const DriverMemory& from, std::size_t used, std::uint8_t* to,
                      int stride) const noexcept {
  if (jpeg_) return jpeg_->decode(from.data, std::min(used, from.length), to, stride);
  announce_reading(from, true);
  convert(format, from.data, to, stride);
  announce_reading(from, false);
  return true;
}

/// Each byte of the driver's memory is read once, by memcpy and so in words: where that memory is not cached, every
/// load costs about 150 ns, and conversions load byte by byte.
void GreyCopies::convert(const DeviceFormat& format, const std::uint8_t* from, std::uint8_t* to,
                         int stride) const noexcept {
  if (is_grey_in_place(format.format))
    return to_grey(format.format, from, format.stride, format.width, format.height, to, stride);
  const int together = is_mosaic(format.format) ? 2 : 1;
  const std::size_t bytes = row_bytes(format.format, format.width);
  for (int y = 0; y + together <= format.height; y += together, to += stride) {
    for (int i = 0; i < together; ++i, from += format.stride)
      std::memcpy(rows_.data() + bytes * static_cast<std::size_t>(i), from, bytes);
    to_grey(format.format, rows_.data(), static_cast<int>(bytes), format.width, together, to, stride);
  }
}

/// Where caches must be brought up to date for reading, the kernel does it then.
void GreyCopies::announce_reading(const DriverMemory& buffer, bool begins) const noexcept {
  if (buffer.file < 0) return;
  dma_buf_sync sync{};
  sync.flags = DMA_BUF_SYNC_READ;
  sync.flags |= begins ? DMA_BUF_SYNC_START : DMA_BUF_SYNC_END;
  for (int i = 0; i < kMostAttempts; ++i)
    if (call_device(system_, buffer.file, DMA_BUF_IOCTL_SYNC, &sync) != EAGAIN) return;
}

}  // namespace epiline
