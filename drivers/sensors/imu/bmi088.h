#pragma once
// Bosch BMI088 over SPI: a gyroscope and an accelerometer with a chip select and a clock each. Data sheet:
// BST-BMI088-DS001, revision 1.4.
#include <array>
#include <memory>

#include "drivers/sensors/imu/bmi088_frames.h"
#include "drivers/sensors/imu/spi_bus.h"
#include "drivers/sensors/imu/spi_imu.h"

namespace epiline {

class Bmi088 final : public ImuChip {
 public:
  /// `timing` outlives it.
  Bmi088(const ImuDeviceConfig& config, std::unique_ptr<SpiBus> gyroscope, std::unique_ptr<SpiBus> accelerometer,
         SpiTiming& timing);

  DeviceTrouble open() noexcept override;
  void close() noexcept override;
  Step start(int step) noexcept override;
  FetchOutcome fetch(ChipBatch& batch) noexcept override;
  DeviceTrouble check_next() noexcept override;
  const char* bus_name() const noexcept override { return gyroscope_->name(); }

 private:
  enum class Half : std::uint8_t { kGyroscope, kAccelerometer };
  struct Register {
    Half half;
    std::uint8_t address, value, mask;
  };
  static constexpr std::size_t kRegisters = 14;
  static constexpr std::size_t kGyroFifoBytes = 600, kAccelFifoBytes = 1024,
                               kMoreBytes = 6;  ///< after the samples: a frame with
                                                ///< the time; before them, perhaps, one that tells of a loss

  void choose(const ImuDeviceConfig& config) noexcept;
  void fill_table(bool rising) noexcept;
  DeviceTrouble identify() noexcept;
  DeviceTrouble configure() noexcept;
  DeviceTrouble compare(const Register& wanted) noexcept;
  bool read(Half half, std::uint8_t address, std::span<std::uint8_t> bytes) noexcept;
  bool write(Half half, std::uint8_t address, std::uint8_t value) noexcept;
  bool flush_gyroscope() noexcept;
  bool flush_accelerometer() noexcept;
  FetchOutcome flush(FetchOutcome outcome) noexcept;
  FetchOutcome fetch_gyroscope(ChipBatch& batch) noexcept;
  FetchOutcome fetch_accelerometer(ChipBatch& batch) noexcept;
  bool is_plausible(std::uint32_t time, HostStamp latched) noexcept;
  void place_accels(ChipBatch& batch) noexcept;

  std::unique_ptr<SpiBus> gyroscope_, accelerometer_;
  SpiTiming* timing_;
  int spi_hz_;
  std::uint8_t gyroscope_code_ = 0, accelerometer_code_ = 0, bandwidth_code_ = 0, accel_conf_ = 0;
  int accel_ticks_ = 16;  ///< of the accelerometer's counter, from sample to sample
  double rad_s_per_count_ = 0, m_s2_per_count_ = 0;
  FixedVector<Register, kRegisters> table_;
  std::size_t next_check_ = 0;

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
