#include "drivers/sensors/imu/adis16470.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "drivers/sensors/imu/spi_chip.h"

namespace epiline {

namespace {

constexpr double kGyroscopeRange_deg_s = 2000, kAccelerometerRange_g = 40;
constexpr double kRadPerCount = 0.1 * kRadPerDeg, kMetrePerCount = 1.25e-3 * kGravity_m_s2;
constexpr double kInternalRate_hz = 2000;
constexpr int kSpiMode = 3, kSpiMost_hz = 2'000'000, kBurstMost_hz = 1'000'000;
constexpr Span kStall{16'000};  // between two words

constexpr std::uint8_t kDiagStat = 0x02, kFilterControl = 0x5C, kMiscControl = 0x60, kDecimation = 0x64,
                       kGlobalCommand = 0x68, kProductId = 0x72;
constexpr std::uint16_t kProduct = 16470, kSoftwareReset = 0x0080;
constexpr std::uint16_t kStatusSpi = 1U << 3;  // a number of clock cycles that is no multiple of 16

/// From motion to output register without filters. The axes of the gyroscope differ: 1.51, 1.51 and 1.29 ms; this is
/// their mean.
constexpr double kGyroscopeDelay_s = 1.44e-3, kAccelerometerDelay_s = 1.57e-3;

}  // namespace

Adis16470::Adis16470(const ImuDeviceConfig& config, std::unique_ptr<SpiBus> bus, SpiTiming& timing)
    : bus_(std::move(bus)), timing_(&timing) {
  register_hz_ = config.spi_hz > 0 ? config.spi_hz : kBurstMost_hz;
  burst_hz_ = std::min(register_hz_, kBurstMost_hz);
  facts_.name = "ADIS16470";
  const int divider = std::clamp(static_cast<int>(kInternalRate_hz / (config.rate_hz * 0.99)), 1, 2000);
  facts_.rate_hz = kInternalRate_hz / divider;
  facts_.period = Span::from_seconds(1 / facts_.rate_hz);
  // the mean of so many samples is as old as their middle
  const double decimation_s = (divider - 1) / 2.0 / kInternalRate_hz;
  facts_.gyroscope_delay = Span::from_seconds(kGyroscopeDelay_s + decimation_s);
  facts_.accelerometer_delay = Span::from_seconds(kAccelerometerDelay_s + decimation_s);
  facts_.settle = Span{2 * facts_.gyroscope_delay.ns};
  facts_.gyroscope_range_deg_s = kGyroscopeRange_deg_s;
  facts_.accelerometer_range_g = kAccelerometerRange_g;
  if (config.gyroscope_range_deg_s > kGyroscopeRange_deg_s * 1.01 || register_hz_ > kSpiMost_hz ||
      config.accelerometer_range_m_s2 > kAccelerometerRange_g * kGravity_m_s2 * 1.01 ||
      config.rate_hz > kInternalRate_hz * 1.01) {
    unfit_.step = "a range, a rate or a clock this chip does not have";
    std::snprintf(unfit_.expected, sizeof(unfit_.expected),
                  "at most 2000 deg/s, 392 m/s^2, rate_hz = 2000, spi_hz = 2000000");
  }
  const bool rising = config.ready_edge == 0;
  table_ = {
      {{kFilterControl, 0, 0x0007},  // no filter besides the decimation
       {kMiscControl, static_cast<std::uint16_t>(0x00C0 | (rising ? 1 : 0)), 0x00FF},  // corrections on, own clock
       {kDecimation, static_cast<std::uint16_t>(divider - 1), 0x07FF}}};
}

// ---- registers ----

bool Adis16470::transfer(std::span<const SpiPart> parts) noexcept {
  timing_->sleep_until(last_transfer_ + kStall);
  bus_error_ = bus_->transfer(parts);
  last_transfer_ = timing_->now();
  return bus_error_ == 0;
}

/// The answer is to the word before.
bool Adis16470::exchange(std::uint16_t word, std::uint16_t& answer) noexcept {
  const std::uint8_t sent[] = {static_cast<std::uint8_t>(word >> 8), static_cast<std::uint8_t>(word)};
  std::uint8_t received[2] = {};
  const SpiPart parts[] = {{.send = sent, .receive = received, .size = 2}};
  transfer(parts);
  answer = static_cast<std::uint16_t>(received[0] << 8 | received[1]);
  return bus_error_ == 0;
}

bool Adis16470::read(std::uint8_t address, std::uint16_t& value) noexcept {
  return exchange(static_cast<std::uint16_t>(address << 8), value) && exchange(0, value);
}

bool Adis16470::write(std::uint8_t address, std::uint16_t value) noexcept {
  std::uint16_t answer = 0;
  const auto half = [&](int at, int byte) {
    return exchange(static_cast<std::uint16_t>((address + at) << 8 | 0x8000 | (byte & 0xff)), answer);
  };
  return half(0, value) && half(1, value >> 8);
}

DeviceTrouble Adis16470::open() noexcept {
  if (const DeviceTrouble trouble = bus_->open(kSpiMode, register_hz_)) return trouble;
  return identify();
}

DeviceTrouble Adis16470::identify() noexcept {
  std::uint16_t product = 0;
  if (!read(kProductId, product)) return device_refusal("PROD_ID", bus_error_);
  if (product == kProduct) return {};
  DeviceTrouble trouble = wrong_identity(product, kProduct);
  if (product > 16000 && product < 17000)  // the number is the name
    std::snprintf(trouble.found, sizeof(trouble.found), "wrong identity 0x%04x, an ADIS%u", product, product);
  return trouble;
}

ImuChip::Step Adis16470::start(int step) noexcept {
  switch (step) {
    case 0:
      if (!write(kGlobalCommand, kSoftwareReset)) return {.trouble = device_refusal("reset", bus_error_)};
      return {.wait = Span::from_milliseconds(250)};  // 193 ms by the data sheet
    case 1:
      if (const DeviceTrouble trouble = identify()) return {.trouble = trouble};
      return {.trouble = configure(), .wait = Span::from_milliseconds(5)};
    default:
      next_check_ = 0;
      counter_.restart();
      return {.done = true};
  }
}

DeviceTrouble Adis16470::configure() noexcept {
  std::uint16_t status = 0;  // reading it clears what it says
  if (!read(kDiagStat, status)) return device_refusal("DIAG_STAT", bus_error_);
  if ((status & ~kStatusSpi) != 0) return wrong_register("the chip's test of itself failed", 0, kDiagStat, status, 0);
  for (const Register& entry : table_) {
    std::uint16_t value = 0;
    const bool is_done = read(entry.address, value) &&
                         write(entry.address, static_cast<std::uint16_t>((value & ~entry.mask) | entry.value));
    if (!is_done) return device_refusal("settings", bus_error_);
  }
  for (const Register& entry : table_)
    if (const DeviceTrouble trouble = compare(entry)) return trouble;
  return {};
}

DeviceTrouble Adis16470::compare(const Register& wanted) noexcept {
  return read_back(
      wanted.value, wanted.mask, bus_error_, [&](std::uint16_t& value) { return read(wanted.address, value); },
      [&](unsigned found) { return wrong_register("settings", 0, wanted.address, found, wanted.value); });
}

DeviceTrouble Adis16470::check_next() noexcept {
  const std::size_t n = next_check_;
  next_check_ = (next_check_ + 1) % (table_.size() + 1);
  return n == 0 ? compare({kProductId, kProduct, 0xFFFF}) : compare(table_[n - 1]);
}

// ---- samples ----

FetchOutcome Adis16470::fetch(ChipBatch& batch) noexcept {
  constexpr std::size_t kCommandBytes = 2;
  std::array<std::uint8_t, kCommandBytes + AdisBurst::kBytes> sent{kGlobalCommand, 0}, received{};
  const SpiPart parts[] = {{.send = sent.data(), .receive = received.data(), .size = sent.size(), .hz = burst_hz_}};
  if (!transfer(parts)) return FetchOutcome::kBusFailed;
  // the chip puts the values together when the command has come; the bits after it take this long at least
  const Span bits{static_cast<std::int64_t>(AdisBurst::kBytes) * 8 * 1'000'000'000 / burst_hz_};
  batch.latched = last_transfer_ - bits;
  AdisBurst burst;
  if (!parse_adis_burst(std::span(received).subspan(kCommandBytes), burst)) {
    ++batch.damaged;
    return FetchOutcome::kGarbled;
  }
  if (const FetchOutcome outcome = judge_status(burst.status, batch); outcome != FetchOutcome::kOk) return outcome;
  const bool is_new = !counter_.started() || counter_.step_to(burst.counter) > 0;
  if (const FetchOutcome outcome = judge_counter(burst.counter, batch); outcome != FetchOutcome::kOk) return outcome;
  batch.temperature_c = burst.temperature_c;
  batch.has_temperature = true;
  if (!is_new) return FetchOutcome::kOk;
  ChipSample sample;
  sample.device = {count_ * facts_.period.ns};
  for (std::size_t i = 0; i < 3; ++i) {
    sample.angular_velocity_rad_s[i] = burst.gyro[i] * kRadPerCount;
    sample.specific_force_m_s2[i] = burst.accel[i] * kMetrePerCount;
  }
  batch.samples.push_back(sample);
  return FetchOutcome::kOk;
}

/// An overrun, a dip of the supply or a sensor that fails its test: only a reset helps.
FetchOutcome Adis16470::judge_status(std::uint16_t status, ChipBatch& batch) noexcept {
  if ((status & kStatusSpi) != 0) ++batch.damaged;
  return (status & 0x00FF & ~kStatusSpi) != 0 ? FetchOutcome::kReset : FetchOutcome::kOk;
}

/// Samples between this one and the last are lost. A counter that does not go on as the time does is that of a chip
/// that was reset, perhaps.
FetchOutcome Adis16470::judge_counter(std::uint16_t counter, ChipBatch& batch) noexcept {
  const bool is_first = !counter_.started();
  const std::int64_t step = counter_.step_to(counter);
  const std::int64_t expected = (batch.latched - last_count_).ns / facts_.period.ns;
  last_count_ = batch.latched;
  count_ = counter_.advance(counter);
  if (is_first) return FetchOutcome::kOk;
  if (std::abs(step - expected) <= expected / 16 + 2) {
    if (step > 1) batch.lost += static_cast<std::uint32_t>(step - 1);
    return FetchOutcome::kOk;
  }
  counter_.restart();
  ++batch.damaged;
  for (const Register& entry : table_) {
    const DeviceTrouble trouble = compare(entry);
    if (trouble) return trouble.error != 0 ? FetchOutcome::kBusFailed : FetchOutcome::kReset;
  }
  return FetchOutcome::kDamaged;
}

}  // namespace epiline
