#include "drivers/sensors/imu/icm42688p_packet.h"

#include "platform/error/contract.h"

namespace epiline {

namespace {

constexpr std::uint8_t kHeaderEmpty = 0x80, kHeaderShort = 0x68, kHeaderLong = 0x78;
constexpr std::uint8_t kHeaderRateBits = 0x03;  // "the rate is another than in the packet before": nothing to us
constexpr std::int32_t kInvalid16 = -32768, kInvalid20 = -524288;

std::int32_t signed16(std::span<const std::uint8_t> bytes, std::size_t at) noexcept {
  return static_cast<std::int16_t>(static_cast<std::uint16_t>(bytes[at] << 8 | bytes[at + 1]));
}

}  // namespace

IcmParse parse_icm_packet(std::span<const std::uint8_t> bytes, IcmPacketKind kind, IcmPacket& packet) noexcept {
  EPILINE_EXPECTS(bytes.size() >= icm_packet_bytes(kind), "a whole packet");
  const bool is_long = kind == IcmPacketKind::kLong;
  if ((bytes[0] & kHeaderEmpty) != 0)
    return bytes[0] == 0xff || bytes[0] == 0x80 ? IcmParse::kEmpty : IcmParse::kDamaged;
  if ((bytes[0] & ~kHeaderRateBits) != (is_long ? kHeaderLong : kHeaderShort)) return IcmParse::kDamaged;
  packet.is_valid = true;
  for (std::size_t i = 0; i < 3; ++i) {
    packet.accel[i] = signed16(bytes, 1 + 2 * i);
    packet.gyro[i] = signed16(bytes, 7 + 2 * i);
    if (is_long) {
      packet.accel[i] = packet.accel[i] * 16 + (bytes[17 + i] >> 4);
      packet.gyro[i] = packet.gyro[i] * 16 + (bytes[17 + i] & 0x0f);
    }
    const std::int32_t invalid = is_long ? kInvalid20 : kInvalid16;
    if (packet.accel[i] == invalid || packet.gyro[i] == invalid) packet.is_valid = false;
  }
  const std::size_t time_at = is_long ? 15 : 14;
  packet.timestamp = static_cast<std::uint16_t>(bytes[time_at] << 8 | bytes[time_at + 1]);
  packet.temperature_c = is_long ? signed16(bytes, 13) / 132.48 + 25 : static_cast<std::int8_t>(bytes[13]) / 2.07 + 25;
  return IcmParse::kData;
}

}  // namespace epiline
