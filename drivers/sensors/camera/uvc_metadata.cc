#include "drivers/sensors/camera/uvc_metadata.h"

namespace epiline {

namespace {

constexpr std::size_t kBefore = 10;  // bytes of the kernel before each header: time, frame number
constexpr std::uint8_t kImageTime = 0x04, kClock = 0x08;

std::uint64_t little_endian(std::span<const std::uint8_t> bytes) noexcept {
  std::uint64_t value = 0;
  for (std::size_t i = bytes.size(); i > 0; --i) value = value << 8 | bytes[i - 1];
  return value;
}

}  // namespace

bool take_header(std::span<const std::uint8_t>& bytes, UvcHeader& header) noexcept {
  const std::size_t length = bytes.size() > kBefore ? bytes[kBefore] : 0;
  if (length < 2 || kBefore + length > bytes.size()) {
    bytes = {};
    return false;
  }
  const std::span<const std::uint8_t> fields = bytes.subspan(kBefore, length);
  const std::uint8_t flags = fields[1];
  header = {};
  header.arrival = {static_cast<std::int64_t>(little_endian(bytes.first(8)))};
  const std::size_t clock_at = (flags & kImageTime) != 0 ? 6 : 2;
  header.has_image_time = clock_at == 6 && length >= 6;
  header.has_clock = (flags & kClock) != 0 && length >= clock_at + 6;
  if (header.has_image_time) header.image_time = static_cast<std::uint32_t>(little_endian(fields.subspan(2, 4)));
  if (header.has_clock) header.clock = static_cast<std::uint32_t>(little_endian(fields.subspan(clock_at, 4)));
  bytes = bytes.subspan(kBefore + length);
  return true;
}

std::uint32_t clock_hz_of(std::span<const std::uint8_t> descriptors, int function) noexcept {
  constexpr std::uint8_t kInterface = 4, kOfClass = 0x24, kVideo = 14, kControl = 1, kHeader = 1;
  bool is_ours = false;
  while (descriptors.size() >= 2) {
    const std::size_t length = descriptors[0];
    if (length < 2 || length > descriptors.size()) return 0;
    const std::span<const std::uint8_t> one = descriptors.first(length);
    if (one[1] == kInterface && length >= 9)
      is_ours = one[2] == function && one[5] == kVideo && one[6] == kControl;
    else if (is_ours && one[1] == kOfClass && length >= 12 && one[2] == kHeader)
      return static_cast<std::uint32_t>(little_endian(one.subspan(7, 4)));
    descriptors = descriptors.subspan(length);
  }
  return 0;
}

}  // namespace epiline
