#include "drivers/sensors/imu/spi_chip.h"

#include "drivers/sensors/trouble.h"

namespace epiline {

RegisterChip::RegisterChip(const char* name, const ChipLimits& limits, const ImuDeviceConfig& config,
                           SpiTiming& timing) noexcept
    : timing_(&timing), spi_hz_(config.spi_hz > 0 ? config.spi_hz : limits.spi_hz) {
  facts_.name = name;
  const double accelerometer_m_s2 = limits.accelerometer_g * kGravity_m_s2;
  if (config.gyroscope_range_deg_s <= limits.gyroscope_deg_s * 1.01 &&
      config.accelerometer_range_m_s2 <= accelerometer_m_s2 * 1.01 && config.rate_hz * 0.99 <= limits.rate_hz &&
      spi_hz_ <= limits.spi_hz)
    return;
  unfit_ = expecting(device_refusal("a range, a rate or a clock this chip does not have", 0),
                     "at most %.0f deg/s, %.0f m/s^2, rate_hz = %.0f, spi_hz = %d", limits.gyroscope_deg_s,
                     accelerometer_m_s2, limits.rate_hz, limits.spi_hz);
}

void RegisterChip::set_table(std::initializer_list<Register> table) noexcept {
  for (const Register& entry : table) table_.push_back(entry);
}

DeviceTrouble RegisterChip::configure(Span pause) noexcept {
  for (const Register& entry : table_) {
    std::uint16_t value = 0;
    const bool is_done = read_register(entry, value) &&
                         write_register(entry, static_cast<std::uint16_t>((value & ~entry.mask) | entry.value));
    if (!is_done) return device_refusal("settings", bus_error_);
  }
  timing_->sleep_until(timing_->now() + pause);
  for (const Register& entry : table_)
    if (const DeviceTrouble trouble = compare(entry)) return trouble;
  return {};
}

DeviceTrouble RegisterChip::compare(const Register& wanted) noexcept {
  std::uint16_t value = 0;
  for (int attempt = 0; attempt < 2; ++attempt) {
    if (!read_register(wanted, value)) return device_refusal("read back", bus_error_);
    if ((value & wanted.mask) == wanted.value) return {};
  }
  return mismatch(wanted, value & wanted.mask);
}

DeviceTrouble RegisterChip::mismatch(const Register& wanted, unsigned found) const noexcept {
  return wrong_register("settings", wanted.bank, wanted.address, found, wanted.value);
}

FetchOutcome RegisterChip::judge(std::span<const Register> wanted) noexcept {
  for (const Register& one : wanted)
    if (const DeviceTrouble trouble = compare(one))
      return trouble.error != 0 ? FetchOutcome::kBusFailed : FetchOutcome::kReset;
  return FetchOutcome::kOk;
}

DeviceTrouble RegisterChip::check_next() noexcept {
  const std::size_t n = next_check_;
  next_check_ = (next_check_ + 1) % (table_.size() + 1);
  return n == 0 ? identify() : compare(table_[n - 1]);
}

}  // namespace epiline
