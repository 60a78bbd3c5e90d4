#include "drivers/sensors/imu/adis16470.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "platform/error/contract.h"

namespace epiline {

namespace {

constexpr ChipLimits kLimits{2000, 40, 2000, 2'000'000};
constexpr double kRadPerCount = 0.1 * kRadPerDeg, kMetrePerCount = 1.25e-3 * kGravity_m_s2;
constexpr int kSpiMode = 3, kBurstMost_hz = 1'000'000;
constexpr Span kStall{16'000};  // between two words

constexpr std::uint8_t kDiagStat = 0x02, kFilterControl = 0x5C, kMiscControl = 0x60, kDecimation = 0x64,
                       kGlobalCommand = 0x68, kProductId = 0x72;
constexpr std::uint16_t kProduct = 16470, kSoftwareReset = 0x0080;
constexpr std::uint16_t kStatusSpi = 1U << 3;  // a number of clock cycles that is no multiple of 16

/// From motion to output register without filters. The axes of the gyroscope differ: 1.51, 1.51 and 1.29 ms; this is
/// their mean.
constexpr double kGyroscopeDelay_s = 1.44e-3, kAccelerometerDelay_s = 1.57e-3;

}  // namespace

bool parse_adis_burst(std::span<const std::uint8_t> bytes, AdisBurst& burst) noexcept {
  EPILINE_EXPECTS(bytes.size() >= AdisBurst::kBytes, "a whole burst");
  constexpr std::size_t kSummed = AdisBurst::kBytes - 2;
  const auto word = [&](std::size_t i) { return static_cast<std::uint16_t>(bytes[2 * i] << 8 | bytes[2 * i + 1]); };
  unsigned sum = 0;
  for (std::size_t i = 0; i < kSummed; ++i) sum += bytes[i];
  if (sum == 0 || sum != word(9)) return false;
  burst.status = word(0);
  for (std::size_t i = 0; i < 3; ++i) {
    burst.gyro[i] = static_cast<std::int16_t>(word(1 + i));
    burst.accel[i] = static_cast<std::int16_t>(word(4 + i));
  }
  burst.temperature_c = static_cast<std::int16_t>(word(7)) * 0.1;
  burst.counter = word(8);
  return true;
}

Adis16470::Adis16470(const ImuDeviceConfig& config, std::unique_ptr<SpiBus> bus, SpiTiming& timing)
    : RegisterChip("ADIS16470", kLimits, config, timing), bus_(std::move(bus)) {
  if (config.spi_hz <= 0) spi_hz_ = kBurstMost_hz;
  burst_hz_ = std::min(spi_hz_, kBurstMost_hz);
  const int divider = std::clamp(static_cast<int>(kLimits.rate_hz / (config.rate_hz * 0.99)), 1, 2000);
  facts_.rate_hz = kLimits.rate_hz / divider;
  facts_.period = Span::from_seconds(1 / facts_.rate_hz);
  // the mean of so many samples is as old as their middle
  const double decimation_s = (divider - 1) / 2.0 / kLimits.rate_hz;
  facts_.gyroscope_delay = Span::from_seconds(kGyroscopeDelay_s + decimation_s);
  facts_.accelerometer_delay = Span::from_seconds(kAccelerometerDelay_s + decimation_s);
  facts_.settle = Span{2 * facts_.gyroscope_delay.ns};
  facts_.gyroscope_range_deg_s = kLimits.gyroscope_deg_s;
  facts_.accelerometer_range_g = kLimits.accelerometer_g;
  const bool rising = config.ready_edge == 0;
  set_table({{0, kFilterControl, 0, 0x0007},  // no filter besides the decimation
                                              // corrections on, own clock
             {0, kMiscControl, static_cast<std::uint16_t>(0x00C0 | (rising ? 1 : 0)), 0x00FF},
             {0, kDecimation, static_cast<std::uint16_t>(divider - 1), 0x07FF}});
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
  if (const DeviceTrouble trouble = bus_->open(kSpiMode, spi_hz_)) return trouble;
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
      return {.trouble = test_and_configure(), .wait = Span::from_milliseconds(5)};
    default:
      next_check_ = 0;
      counter_.restart();
      return {.done = true};
  }
}

DeviceTrouble Adis16470::test_and_configure() noexcept {
  std::uint16_t status = 0;  // reading it clears what it says
  if (!read(kDiagStat, status)) return device_refusal("DIAG_STAT", bus_error_);
  if ((status & ~kStatusSpi) != 0) return wrong_register("the chip's test of itself failed", 0, kDiagStat, status, 0);
  return configure();
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
  const FetchOutcome outcome = judge({table_.begin(), table_.end()});
  return outcome == FetchOutcome::kOk ? FetchOutcome::kDamaged : outcome;
}

}  // namespace epiline
