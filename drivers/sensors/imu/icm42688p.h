#pragma once
// TDK ICM-42688-P over SPI. Data sheet: DS-000347, revision 1.8.
#include <array>
#include <memory>

#include "drivers/sensors/imu/icm42688p_packet.h"
#include "drivers/sensors/imu/spi_bus.h"
#include "drivers/sensors/imu/spi_imu.h"

namespace epiline {

class Icm42688p final : public ImuChip {
 public:
  /// `timing` outlives it.
  Icm42688p(const ImuDeviceConfig& config, std::unique_ptr<SpiBus> bus, SpiTiming& timing);

  DeviceTrouble open() noexcept override;
  void close() noexcept override { bus_->close(); }
  Step start(int step) noexcept override;
  FetchOutcome fetch(ChipBatch& batch) noexcept override;
  DeviceTrouble check_next() noexcept override;
  const char* bus_name() const noexcept override { return bus_->name(); }

 private:
  struct Register {
    std::uint8_t bank, address, value, mask;
  };
  static constexpr std::size_t kRegisters = 24;
  static constexpr std::size_t kFifoBytes = 2080;  ///< the most that can be in it, section 6.3

  void choose(const ImuDeviceConfig& config) noexcept;
  void fill_table(bool rising) noexcept;
  DeviceTrouble identify() noexcept;
  DeviceTrouble configure() noexcept;
  DeviceTrouble compare(const Register& wanted) noexcept;
  bool read(std::uint8_t address, std::span<std::uint8_t> bytes) noexcept;
  bool write(std::uint8_t address, std::uint8_t value) noexcept;
  bool select_bank(std::uint8_t bank) noexcept;
  FetchOutcome flush(FetchOutcome outcome) noexcept;
  FetchOutcome parse(std::span<const std::uint8_t> bytes, ChipBatch& batch) noexcept;
  bool time_of(std::uint16_t timestamp, DeviceStamp& device) noexcept;
  /// 15 times the nanoseconds of so many counts. The registers speak of counts of 1 or 16 us, but mean them for 20.48
  /// MHz. The PLL of this chip runs at 19.2 MHz, so a count lasts 16/15 of that.
  std::int64_t times_15(std::int64_t counts) const noexcept { return counts * (counts_of_16us_ ? 256'000 : 16'000); }

  std::unique_ptr<SpiBus> bus_;
  SpiTiming* timing_;
  int spi_hz_;
  IcmPacketKind kind_ = IcmPacketKind::kShort;
  std::uint8_t rate_code_ = 0, gyroscope_code_ = 0, accelerometer_code_ = 0;
  int anti_alias_ = 0;         ///< row of the table
  int counts_per_sample_ = 0;  ///< of the time stamp
  bool counts_of_16us_ = false;
  double rad_s_per_count_ = 0, m_s2_per_count_ = 0;
  FixedVector<Register, kRegisters> table_;
  std::size_t next_check_ = 0;

  ChipCounter<16> counter_;
  int strange_times_ = 0;
  std::array<std::uint8_t, kFifoBytes + 1> sent_{}, received_{};
};

}  // namespace epiline
