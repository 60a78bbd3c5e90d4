#pragma once
// TDK ICM-42688-P over SPI. Data sheet: DS-000347, revision 1.8.
#include <array>
#include <memory>

#include "drivers/sensors/imu/spi_chip.h"

namespace epiline {

// Packets of its FIFO: sections 6.1 and 6.2.

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

class Icm42688p final : public RegisterChip {
 public:
  /// `timing` outlives it.
  Icm42688p(const ImuDeviceConfig& config, std::unique_ptr<SpiBus> bus, SpiTiming& timing);

  DeviceTrouble open() noexcept override;
  void close() noexcept override { bus_->close(); }
  Step start(int step) noexcept override;
  FetchOutcome fetch(ChipBatch& batch) noexcept override;
  const char* bus_name() const noexcept override { return bus_->name(); }

 private:
  static constexpr std::size_t kFifoBytes = 2080;  ///< the most that can be in it, section 6.3

  DeviceTrouble identify() noexcept override;
  DeviceTrouble identify_in_any_bank() noexcept;
  bool read(std::uint8_t address, std::span<std::uint8_t> bytes) noexcept {
    return (bus_error_ = bus_->read_bytes(address, bytes)) == 0;
  }
  bool write(std::uint8_t address, std::uint8_t value) noexcept {
    return (bus_error_ = bus_->write_byte(address, value)) == 0;
  }
  bool select_bank(std::uint8_t bank) noexcept;
  bool read_register(const Register& at, std::uint16_t& value) noexcept override;
  bool write_register(const Register& at, std::uint16_t value) noexcept override;
  FetchOutcome flush(FetchOutcome outcome) noexcept;
  FetchOutcome parse(std::span<const std::uint8_t> bytes, ChipBatch& batch) noexcept;
  bool time_of(std::uint16_t timestamp, DeviceStamp& device) noexcept;
  /// 15 times the nanoseconds of so many counts. The registers speak of counts of 1 or 16 us, but mean them for 20.48
  /// MHz. The PLL of this chip runs at 19.2 MHz, so a count lasts 16/15 of that.
  std::int64_t times_15(std::int64_t counts) const noexcept { return counts * (counts_of_16us_ ? 256'000 : 16'000); }

  std::unique_ptr<SpiBus> bus_;
  IcmPacketKind kind_ = IcmPacketKind::kShort;
  int counts_per_sample_ = 0;  ///< of the time stamp
  bool counts_of_16us_ = false;
  double rad_s_per_count_ = 0, m_s2_per_count_ = 0;

  ChipCounter<16> counter_;
  int strange_times_ = 0;
  std::array<std::uint8_t, kFifoBytes + 1> sent_{}, received_{};
};

}  // namespace epiline
