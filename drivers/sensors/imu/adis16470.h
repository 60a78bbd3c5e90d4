#pragma once
// Analog Devices ADIS16470 over SPI. Data sheet: ADIS16470, revision C.
#include <array>
#include <memory>

#include "drivers/sensors/imu/spi_chip.h"

namespace epiline {

/// "Burst read function".
struct AdisBurst {
  static constexpr std::size_t kBytes = 20;  ///< after the command
  std::uint16_t status = 0;                  ///< DIAG_STAT
  std::array<std::int16_t, 3> gyro{}, accel{};
  double temperature_c = 0;
  std::uint16_t counter = 0;  ///< DATA_CNTR
};
/// `bytes` has at least AdisBurst::kBytes. False: the checksum is wrong, or all is 0, which no chip sends.
bool parse_adis_burst(std::span<const std::uint8_t> bytes, AdisBurst& burst) noexcept;

class Adis16470 final : public RegisterChip {
 public:
  /// `timing` outlives it.
  Adis16470(const ImuDeviceConfig& config, std::unique_ptr<SpiBus> bus, SpiTiming& timing);

  DeviceTrouble open() noexcept override;
  void close() noexcept override { bus_->close(); }
  Step start(int step) noexcept override;
  FetchOutcome fetch(ChipBatch& batch) noexcept override;
  const char* bus_name() const noexcept override { return bus_->name(); }

 private:
  bool transfer(std::span<const SpiPart> parts) noexcept;
  bool exchange(std::uint16_t word, std::uint16_t& answer) noexcept;
  bool read(std::uint8_t address, std::uint16_t& value) noexcept;
  bool write(std::uint8_t address, std::uint16_t value) noexcept;
  bool read_register(const Register& at, std::uint16_t& value) noexcept override { return read(at.address, value); }
  bool write_register(const Register& at, std::uint16_t value) noexcept override { return write(at.address, value); }
  DeviceTrouble identify() noexcept override;
  DeviceTrouble test_and_configure() noexcept;
  FetchOutcome judge_status(std::uint16_t status, ChipBatch& batch) noexcept;
  FetchOutcome judge_counter(std::uint16_t counter, ChipBatch& batch) noexcept;

  std::unique_ptr<SpiBus> bus_;
  int burst_hz_;
  ChipCounter<16> counter_;
  std::int64_t count_ = 0;
  HostStamp last_transfer_;
  HostStamp last_count_;  ///< when the counter was last read
};

}  // namespace epiline
