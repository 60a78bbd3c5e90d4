#include "drivers/sensors/camera/buffer_reading.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace epiline {

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

}  // namespace epiline
