#pragma once
// Analog Devices ADIS16470 over SPI. Data sheet: ADIS16470, revision C.
#include <array>
#include <memory>

#include "drivers/sensors/imu/adis16470_burst.h"
#include "drivers/sensors/imu/spi_bus.h"
#include "drivers/sensors/imu/spi_imu.h"

namespace epiline {

class Adis16470 final : public ImuChip {
 public:
  /// `timing` outlives it.
  Adis16470(const ImuDeviceConfig& config, std::unique_ptr<SpiBus> bus, SpiTiming& timing);

  DeviceTrouble open() noexcept override;
  void close() noexcept override { bus_->close(); }
  Step start(int step) noexcept override;
  FetchOutcome fetch(ChipBatch& batch) noexcept override;
  DeviceTrouble check_next() noexcept override;
  const char* bus_name() const noexcept override { return bus_->name(); }

 private:
  struct Register {
    std::uint8_t address;
    std::uint16_t value, mask;
  };

  bool transfer(std::span<const SpiPart> parts) noexcept;
  bool exchange(std::uint16_t word, std::uint16_t& answer) noexcept;
  bool read(std::uint8_t address, std::uint16_t& value) noexcept;
  bool write(std::uint8_t address, std::uint16_t value) noexcept;
  DeviceTrouble identify() noexcept;
  DeviceTrouble configure() noexcept;
  DeviceTrouble compare(const Register& wanted) noexcept;
  FetchOutcome judge_status(std::uint16_t status, ChipBatch& batch) noexcept;
  FetchOutcome judge_counter(std::uint16_t counter, ChipBatch& batch) noexcept;

  std::unique_ptr<SpiBus> bus_;
  SpiTiming* timing_;
  int register_hz_, burst_hz_;
  std::array<Register, 3> table_{};
  std::size_t next_check_ = 0;

  ChipCounter<16> counter_;
  std::int64_t count_ = 0;
  HostStamp last_transfer_;
  HostStamp last_count_;  ///< when the counter was last read
};

}  // namespace epiline
