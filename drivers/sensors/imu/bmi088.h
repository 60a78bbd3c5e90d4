#pragma once
// Bosch BMI088 over SPI: a gyroscope and an accelerometer with a chip select and a clock each. Data sheet:
// BST-BMI088-DS001, revision 1.4.
#include <array>
#include <memory>

#include "drivers/sensors/imu/spi_chip.h"

namespace epiline {

using BmiVector = std::array<std::int16_t, 3>;

/// What the accelerometer's FIFO holds: sections 4.9 and 5.3.
struct BmiAccelFrames {
  static constexpr std::size_t kMost = 160;  ///< more than the 1024 bytes of the FIFO can hold
  FixedVector<BmiVector, kMost> values;      ///< in a row up to the newest
  std::uint32_t skipped = 0;                 ///< lost before them: the FIFO was full
  bool has_time = false;
  std::uint32_t time = 0;  ///< the 24 bit counter when the FIFO had been read to its end
};
/// Frames with a header each, up to the end of the bytes, an incomplete frame, or the mark of an empty FIFO. False:
/// there was a header of no frame; `frames` has those before it.
bool parse_bmi_accel(std::span<const std::uint8_t> bytes, BmiAccelFrames& frames) noexcept;

class Bmi088 final : public RegisterChip {
 public:
  /// `timing` outlives it.
  Bmi088(const ImuDeviceConfig& config, std::unique_ptr<SpiBus> gyroscope, std::unique_ptr<SpiBus> accelerometer,
         SpiTiming& timing);

  DeviceTrouble open() noexcept override;
  void close() noexcept override;
  Step start(int step) noexcept override;
  FetchOutcome fetch(ChipBatch& batch) noexcept override;
  const char* bus_name() const noexcept override { return gyroscope_->name(); }

 private:
  enum Half : std::uint8_t { kAccelerometer, kGyroscope };  ///< the banks of registers
  static constexpr std::size_t kGyroFifoBytes = 600, kAccelFifoBytes = 1024,
                               kMoreBytes = 6;  ///< after the samples: a frame with
                                                ///< the time; before them, perhaps, one that tells of a loss

  DeviceTrouble identify() noexcept override;
  DeviceTrouble mismatch(const Register& wanted, unsigned found) const noexcept override;
  bool read(unsigned half, std::uint8_t address, std::span<std::uint8_t> bytes) noexcept;
  bool write(unsigned half, std::uint8_t address, std::uint8_t value) noexcept;
  bool read_register(const Register& at, std::uint16_t& value) noexcept override;
  bool write_register(const Register& at, std::uint16_t value) noexcept override;
  bool flush_gyroscope() noexcept;
  bool flush_accelerometer() noexcept;
  FetchOutcome flush(FetchOutcome outcome) noexcept;
  FetchOutcome fetch_gyroscope(ChipBatch& batch) noexcept;
  FetchOutcome fetch_accelerometer(ChipBatch& batch) noexcept;
  bool is_plausible(std::uint32_t time, HostStamp latched) noexcept;
  void place_accels(ChipBatch& batch) noexcept;

  std::unique_ptr<SpiBus> gyroscope_, accelerometer_;
  std::uint8_t gyroscope_code_ = 0, bandwidth_code_ = 0;
  int accel_ticks_ = 16;  ///< of the accelerometer's counter, from sample to sample
  double rad_s_per_count_ = 0, m_s2_per_count_ = 0;

  std::int64_t gyro_samples_ = 0;
  ChipCounter<24> counter_;
  std::int64_t count_offset_ = 0;  ///< of the counter at its start, so that its low bits are the chip's
  std::int64_t next_accel_count_ = -1;
  HostStamp last_accel_, last_time_;  ///< when it last had a sample; when its counter was last read
  int strange_times_ = 0;
  BmiAccelFrames frames_;
  std::array<std::uint8_t, kAccelFifoBytes + kMoreBytes> received_{};
};

}  // namespace epiline
