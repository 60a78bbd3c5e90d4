#pragma once
// What the drivers of chips share: units of data sheets, ranges, registers that are set and compared.
#include <initializer_list>
#include <numbers>
#include <span>

#include "drivers/sensors/imu/spi_identity.h"
#include "drivers/sensors/imu/spi_imu.h"

namespace epiline {

inline constexpr double kGravity_m_s2 = 9.80665, kRadPerDeg = std::numbers::pi / 180;

/// The place of the smallest range that is enough, in a list from the largest to the smallest; a hundredth is given
/// away for rounded figures. 0: none is.
constexpr std::uint8_t smallest_range(std::span<const double> ranges, double wanted) noexcept {
  std::uint8_t place = 0;
  for (std::size_t i = 0; i < ranges.size(); ++i)
    if (ranges[i] * 1.01 >= wanted) place = static_cast<std::uint8_t>(i);
  return place;
}

/// Of a Butterworth filter of second order, at low frequencies.
inline double second_order_delay_s(double bandwidth_hz) noexcept {
  return std::numbers::sqrt2 / (2 * std::numbers::pi * bandwidth_hz);
}

/// The most that a chip can do.
struct ChipLimits {
  double gyroscope_deg_s, accelerometer_g, rate_hz;
  int spi_hz;
};

/// A chip whose settings are registers: set in the order of a table, read back, and compared one by one in flight.
class RegisterChip : public ImuChip {
 public:
  DeviceTrouble check_next() noexcept override;

 protected:
  struct Register {
    std::uint8_t bank, address;
    std::uint16_t value, mask;
  };

  /// `timing` outlives it.
  RegisterChip(const char* name, const ChipLimits& limits, const ImuDeviceConfig& config, SpiTiming& timing) noexcept;

  /// Each false: `bus_error_` says why.
  virtual bool read_register(const Register& at, std::uint16_t& value) noexcept = 0;
  virtual bool write_register(const Register& at, std::uint16_t value) noexcept = 0;
  virtual DeviceTrouble identify() noexcept = 0;
  virtual DeviceTrouble mismatch(const Register& wanted, unsigned found) const noexcept;

  void set_table(std::initializer_list<Register> table) noexcept;
  /// `pause`: between writing and reading back.
  DeviceTrouble configure(Span pause = {}) noexcept;
  /// A value that is wrong may be garbled, so it is read once more.
  DeviceTrouble compare(const Register& wanted) noexcept;
  /// Of a chip that may have lost its settings: kOk if it still has these, else kReset or kBusFailed.
  FetchOutcome judge(std::span<const Register> wanted) noexcept;

  SpiTiming* timing_;
  int spi_hz_;
  FixedVector<Register, 25> table_;
  std::size_t next_check_ = 0;
};

}  // namespace epiline
