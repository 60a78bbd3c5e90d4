#include "drivers/sensors/imu/bmi088_frames.h"

#include "platform/error/contract.h"

namespace epiline {

namespace {

// Headers without the two lowest bits, which tell of interrupt inputs.
constexpr std::uint8_t kData = 0x84, kSkip = 0x40, kTime = 0x44, kConfig = 0x48, kDrop = 0x50, kEmpty = 0x80;
constexpr std::uint8_t kHeaderBits = 0xFC;

std::int16_t little_endian(std::span<const std::uint8_t> bytes, std::size_t at) noexcept {
  return static_cast<std::int16_t>(static_cast<std::uint16_t>(bytes[at + 1] << 8 | bytes[at]));
}

std::size_t frame_bytes(std::uint8_t header) noexcept {
  switch (header & kHeaderBits) {
    case kData:
      return 7;
    case kTime:
      return 4;
    case kSkip:
    case kConfig:
    case kDrop:
      return 2;
    default:
      return 0;
  }
}

}  // namespace

bool parse_bmi_accel(std::span<const std::uint8_t> bytes, BmiAccelFrames& frames) noexcept {
  frames.values.clear();
  frames.skipped = 0;
  frames.has_time = false;
  while (!bytes.empty()) {
    const std::uint8_t header = bytes[0];
    if ((header & kHeaderBits) == kEmpty) return true;
    const std::size_t size = frame_bytes(header);
    if (size == 0) return false;
    if (size > bytes.size()) return true;  // it comes again, whole
    switch (header & kHeaderBits) {
      case kData:
        if (!frames.values.push_back({little_endian(bytes, 1), little_endian(bytes, 3), little_endian(bytes, 5)}))
          return false;
        break;
      case kSkip:
        frames.skipped += bytes[1];
        frames.values.clear();  // they are not in a row with what follows
        break;
      case kTime:
        frames.has_time = true;
        frames.time = bytes[1] | static_cast<std::uint32_t>(bytes[2]) << 8 | static_cast<std::uint32_t>(bytes[3]) << 16;
        return true;  // the FIFO is empty
      default:
        break;
    }
    bytes = bytes.subspan(size);
  }
  return true;
}

BmiVector parse_bmi_gyro(std::span<const std::uint8_t> bytes) noexcept {
  EPILINE_EXPECTS(bytes.size() >= kBmiGyroFrame, "a whole frame");
  return {little_endian(bytes, 0), little_endian(bytes, 2), little_endian(bytes, 4)};
}

}  // namespace epiline
