#pragma once
// Packets of the ICM-42688-P's FIFO: data sheet DS-000347, sections 6.1 and 6.2.
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace epiline {

enum class IcmPacketKind : std::uint8_t {
  kShort,  ///< packet 3: 16 bytes, 16 bits a value
  kLong,   ///< packet 4: 20 bytes, 20 bits a value, full range only
};
constexpr std::size_t icm_packet_bytes(IcmPacketKind kind) { return kind == IcmPacketKind::kLong ? 20 : 16; }

struct IcmPacket {
  std::array<std::int32_t, 3> accel{}, gyro{};  ///< of 16 or 20 bits
  bool is_valid = false;                        ///< both sensors had a value
  std::uint16_t timestamp = 0;
  double temperature_c = 0;
};

enum class IcmParse : std::uint8_t {
  kData,
  kEmpty,    ///< the FIFO had no more
  kDamaged,  ///< no header of such a packet
};

/// `bytes` has at least icm_packet_bytes(kind).
IcmParse parse_icm_packet(std::span<const std::uint8_t> bytes, IcmPacketKind kind, IcmPacket& packet) noexcept;

}  // namespace epiline
