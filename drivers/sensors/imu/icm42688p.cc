#include "drivers/sensors/imu/icm42688p.h"

#include <cmath>
#include <cstdlib>

#include "platform/error/contract.h"

namespace epiline {

namespace {

constexpr ChipLimits kLimits{2000, 16, 8000, 24'000'000};
constexpr int kSpiMode = 0;
constexpr std::uint8_t kIdentity = 0x47;

// Registers of bank 0 that are used by name.
constexpr std::uint8_t kDeviceConfig = 0x11, kIntStatus = 0x2D, kFifoData = 0x30, kSignalPathReset = 0x4B,
                       kPowerManagement = 0x4E, kWhoAmI = 0x75, kBankSelect = 0x76;
constexpr std::uint8_t kStatusReset = 0x10, kStatusFull = 0x02;
constexpr std::uint8_t kSoftReset = 0x01, kFlush = 0x02, kBothLowNoise = 0x0F;

/// Rates in low-noise mode, and what section 5.5 says of the UI filter of second order with a bandwidth of half the
/// rate: its group delay.
struct Rate {
  double hz;
  std::uint8_t code;
  double delay_ms;
};
constexpr Rate kRates[] = {{12.5, 11, 25.7}, {25, 10, 25.7}, {50, 9, 12.9},  {100, 8, 6.5},  {200, 7, 3.3},
                           {500, 15, 1.3},   {1000, 6, 0.7}, {2000, 5, 0.8}, {4000, 4, 0.4}, {8000, 3, 0.2}};

/// Some rows of the table in section 5.3. A filter of second order.
struct AntiAlias {
  double hz;
  std::uint8_t delta;
  std::uint16_t delta_squared;
  std::uint8_t shift;
};
constexpr AntiAlias kAntiAlias[] = {{213, 5, 25, 10},   {258, 6, 36, 10},    {536, 12, 144, 8},
                                    {1051, 22, 488, 6}, {2029, 38, 1440, 4}, {3979, 63, 3968, 3}};

constexpr double kGyroscopeRanges_deg_s[] = {2000, 1000, 500, 250, 125, 62.5, 31.25, 15.625};  // by code
constexpr double kAccelerometerRanges_g[] = {16, 8, 4, 2};

constexpr std::uint8_t kHeaderEmpty = 0x80, kHeaderShort = 0x68, kHeaderLong = 0x78;
constexpr std::uint8_t kHeaderRateBits = 0x03;  // "the rate is another than in the packet before": nothing to us
constexpr std::int32_t kInvalid16 = -32768, kInvalid20 = -524288;

std::int32_t signed16(std::span<const std::uint8_t> bytes, std::size_t at) noexcept {
  return static_cast<std::int16_t>(static_cast<std::uint16_t>(bytes[at] << 8 | bytes[at + 1]));
}

}  // namespace

IcmParse parse_icm_packet(std::span<const std::uint8_t> bytes, IcmPacketKind kind, IcmPacket& packet) noexcept {
  EPILINE_EXPECTS(bytes.size() >= icm_packet_bytes(kind), "a whole packet");
  const bool is_long = kind == IcmPacketKind::kLong;
  if ((bytes[0] & kHeaderEmpty) != 0)
    return bytes[0] == 0xff || bytes[0] == 0x80 ? IcmParse::kEmpty : IcmParse::kDamaged;
  if ((bytes[0] & ~kHeaderRateBits) != (is_long ? kHeaderLong : kHeaderShort)) return IcmParse::kDamaged;
  packet.is_valid = true;
  for (std::size_t i = 0; i < 3; ++i) {
    packet.accel[i] = signed16(bytes, 1 + 2 * i);
    packet.gyro[i] = signed16(bytes, 7 + 2 * i);
    if (is_long) {
      packet.accel[i] = packet.accel[i] * 16 + (bytes[17 + i] >> 4);
      packet.gyro[i] = packet.gyro[i] * 16 + (bytes[17 + i] & 0x0f);
    }
    const std::int32_t invalid = is_long ? kInvalid20 : kInvalid16;
    if (packet.accel[i] == invalid || packet.gyro[i] == invalid) packet.is_valid = false;
  }
  const std::size_t time_at = is_long ? 15 : 14;
  packet.timestamp = static_cast<std::uint16_t>(bytes[time_at] << 8 | bytes[time_at + 1]);
  packet.temperature_c = is_long ? signed16(bytes, 13) / 132.48 + 25 : static_cast<std::int8_t>(bytes[13]) / 2.07 + 25;
  return IcmParse::kData;
}

Icm42688p::Icm42688p(const ImuDeviceConfig& config, std::unique_ptr<SpiBus> bus, SpiTiming& timing)
    : RegisterChip("ICM-42688-P", kLimits, config, timing), bus_(std::move(bus)) {
  const Rate* rate = std::begin(kRates);
  while (rate + 1 != std::end(kRates) && rate->hz < config.rate_hz * 0.99) ++rate;
  const AntiAlias* filter = std::begin(kAntiAlias);
  while (filter + 1 != std::end(kAntiAlias) && filter->hz < rate->hz / 2) ++filter;
  const int gyroscope = smallest_range(kGyroscopeRanges_deg_s, config.gyroscope_range_deg_s);
  const int accelerometer = smallest_range(kAccelerometerRanges_g, config.accelerometer_range_m_s2 / kGravity_m_s2);
  // packets of 20 bit have the full ranges, whatever the range registers say
  const bool is_long = gyroscope == 0 && accelerometer == 0;
  kind_ = is_long ? IcmPacketKind::kLong : IcmPacketKind::kShort;
  facts_.gyroscope_range_deg_s = kGyroscopeRanges_deg_s[gyroscope];
  facts_.accelerometer_range_g = kAccelerometerRanges_g[accelerometer];
  const double full = is_long ? 524288 : 32768;
  rad_s_per_count_ = facts_.gyroscope_range_deg_s / full * kRadPerDeg;
  m_s2_per_count_ = facts_.accelerometer_range_g / full * kGravity_m_s2;

  facts_.rate_hz = rate->hz;
  facts_.period = Span::from_seconds(1 / rate->hz);
  facts_.settle = Span::from_milliseconds(60);  // the gyroscope starts within 30 ms, typically; its filters settle
  counts_of_16us_ = rate->hz < 50;              // 1.1 s until the stamp wraps, else 70 ms
  counts_per_sample_ = static_cast<int>(facts_.period.ns * 15 / times_15(1));
  facts_.clock_tolerance = 0.02;  // with the PLL 1 % over all chips and temperatures; the host's is far better
  facts_.gyroscope_delay = facts_.accelerometer_delay =
      Span::from_seconds(rate->delay_ms * 1e-3 + second_order_delay_s(filter->hz));

  // In the order in which they are written. Masks leave out bits the data sheet calls reserved.
  const bool rising = config.ready_edge == 0, is_fast = facts_.rate_hz >= 4000;
  const auto byte = [](int value) { return static_cast<std::uint8_t>(value); };
  const std::uint8_t squared_low = byte(filter->delta_squared & 0xff);
  const std::uint8_t squared_high = byte(filter->shift << 4 | filter->delta_squared >> 8);
  set_table({
      {0, kBankSelect, 0x00, 0x07},
      {1, 0x0B, 0x00, 0x03},                           // gyroscope: notch and anti-alias filter are on
      {1, 0x0C, filter->delta, 0x3F},                  //
      {1, 0x0D, squared_low, 0xFF},                    //
      {1, 0x0E, squared_high, 0xFF},                   //
      {2, 0x03, byte(filter->delta << 1), 0x7F},       // accelerometer: anti-alias filter is on
      {2, 0x04, squared_low, 0xFF},                    //
      {2, 0x05, squared_high, 0xFF},                   //
      {0, 0x14, byte(0x02 | (rising ? 1 : 0)), 0x07},  // INT1: pulses, push-pull, active high or low
      {0, 0x4C, 0x70 | 0x03, 0xF3},  // FIFO count in packets, big endian; invalid samples are marked; SPI only
      // Clock: PLL when it is there. The vendor's undocumented AFSR is off: with it the gyroscope repeats itself for
      // 1 to 2 ms whenever a rate passes 100 deg/s.
      {0, 0x4D, 0x41, 0xC7},
      {0, 0x4F, byte(gyroscope << 5 | rate->code), 0xEF},
      {0, 0x50, byte(accelerometer << 5 | rate->code), 0xEF},
      {0, 0x51, 0x06, 0x0F},                                       // gyroscope UI filter of second order
      {0, 0x52, 0x00, 0xFF},                                       // bandwidth of both: half the rate
      {0, 0x53, 0x0C, 0x1E},                                       // accelerometer UI filter of second order
      {0, 0x54, byte(0x01 | (counts_of_16us_ ? 0x08 : 0)), 0x1F},  // time stamps, no FSYNC
      {0, 0x60, 0x01, 0xFF},                                       // FIFO threshold: one packet
      {0, 0x61, 0x00, 0x0F},                                       //
      {0, 0x5F, byte(0x27 | (is_long ? 0x10 : 0)), 0x7F},          // both, temperature; at each packet
      {0, 0x63, 0x00, 0x3F},
      {0, 0x64, byte(is_fast ? 0x60 : 0x00), 0x70},  // pulses of 100 or 8 us; "user should" clear INT_ASYNC_RESET
      {0, 0x65, 0x04, 0x7F},                         // INT1: FIFO threshold
      {0, 0x16, 0x80, 0xC0},                         // the FIFO stops when full
      {0, kPowerManagement, kBothLowNoise, 0x3F},    // last: both sensors on
  });
}

// ---- registers ----

bool Icm42688p::select_bank(std::uint8_t bank) noexcept { return write(kBankSelect, bank); }

bool Icm42688p::read_register(const Register& at, std::uint16_t& value) noexcept {
  std::uint8_t byte = 0;
  const bool is_read =
      (at.bank == 0 || select_bank(at.bank)) && read(at.address, {&byte, 1}) && (at.bank == 0 || select_bank(0));
  value = byte;
  return is_read;
}

bool Icm42688p::write_register(const Register& at, std::uint16_t value) noexcept {
  return (at.bank == 0 || select_bank(at.bank)) && write(at.address, static_cast<std::uint8_t>(value)) &&
         (at.bank == 0 || select_bank(0));
}

DeviceTrouble Icm42688p::identify() noexcept {
  std::uint8_t identity = 0;
  if (!read(kWhoAmI, {&identity, 1})) return device_refusal("WHO_AM_I", bus_error_);
  return identity == kIdentity ? DeviceTrouble{} : wrong_identity(identity, kIdentity);
}

/// While it runs a wrong bank is an error; before, anything may be selected.
DeviceTrouble Icm42688p::identify_in_any_bank() noexcept {
  return select_bank(0) ? identify() : device_refusal("WHO_AM_I", bus_error_);
}

DeviceTrouble Icm42688p::open() noexcept {
  if (const DeviceTrouble trouble = bus_->open(kSpiMode, spi_hz_)) return trouble;
  return identify_in_any_bank();
}

ImuChip::Step Icm42688p::start(int step) noexcept {
  switch (step) {
    case 0:  // the chip may be in any state: reset it
      if (!select_bank(0) || !write(kDeviceConfig, kSoftReset)) return {.trouble = device_refusal("reset", bus_error_)};
      return {.wait = Span::from_milliseconds(2)};  // 1 ms by the data sheet
    case 1: {
      if (const DeviceTrouble trouble = identify_in_any_bank()) return {.trouble = trouble};
      std::uint8_t status = 0;  // reading it clears what it says
      if (!read(kIntStatus, {&status, 1})) return {.trouble = device_refusal("status", bus_error_)};
      if ((status & kStatusReset) == 0)
        return {.trouble = wrong_register("the chip did not reset", 0, kIntStatus, status, kStatusReset)};
      // nothing is written within 0.2 ms of power on
      return {.trouble = configure(Span{300'000}), .wait = Span::from_milliseconds(1)};
    }
    default:
      if (flush(FetchOutcome::kOk) != FetchOutcome::kOk) return {.trouble = device_refusal("FIFO", bus_error_)};
      next_check_ = 0;
      return {.done = true};
  }
}

// ---- samples ----

FetchOutcome Icm42688p::flush(FetchOutcome outcome) noexcept {
  counter_.restart();
  strange_times_ = 0;
  return write(kSignalPathReset, kFlush) ? outcome : FetchOutcome::kBusFailed;
}

FetchOutcome Icm42688p::fetch(ChipBatch& batch) noexcept {
  std::array<std::uint8_t, 3> head{};  // INT_STATUS, FIFO_COUNTH, FIFO_COUNTL
  if (!read(kIntStatus, head)) return FetchOutcome::kBusFailed;
  batch.latched = timing_->now();
  const std::size_t count = static_cast<std::size_t>(head[1] << 8 | head[2]);
  const std::size_t bytes = count * icm_packet_bytes(kind_);
  if (bytes > kFifoBytes) {  // a dead line, or the count is of another meaning since a reset
    ++batch.damaged;
    return flush(FetchOutcome::kDamaged);
  }
  if ((head[0] & kStatusReset) != 0) {
    ++batch.damaged;  // if the sensors are still on
    const Register power[] = {{0, kPowerManagement, kBothLowNoise, 0x3F}};
    return judge(power);
  }
  if ((head[0] & kStatusFull) != 0) {
    batch.lost += static_cast<std::uint32_t>(count);
    return flush(FetchOutcome::kOverflow);
  }
  if (count == 0) return FetchOutcome::kOk;
  // one transfer, for the FIFO must not be left in the middle of a packet
  sent_[0] = kFifoData | kReadBit;
  const SpiPart parts[] = {{.send = sent_.data(), .receive = received_.data(), .size = bytes + 1}};
  bus_error_ = bus_->transfer(parts);
  if (bus_error_ != 0) return FetchOutcome::kBusFailed;
  return parse({received_.data() + 1, bytes}, batch);
}

FetchOutcome Icm42688p::parse(std::span<const std::uint8_t> bytes, ChipBatch& batch) noexcept {
  const std::size_t size = icm_packet_bytes(kind_);
  for (std::size_t at = 0; at + size <= bytes.size(); at += size) {
    IcmPacket packet;
    const IcmParse outcome = parse_icm_packet(bytes.subspan(at, size), kind_, packet);
    if (outcome == IcmParse::kEmpty) break;
    ChipSample sample;
    if (outcome == IcmParse::kDamaged || !time_of(packet.timestamp, sample.device)) {
      ++batch.damaged;
      return flush(FetchOutcome::kDamaged);
    }
    batch.temperature_c = packet.temperature_c;
    batch.has_temperature = true;
    if (!packet.is_valid) continue;  // a sensor that is starting
    for (std::size_t i = 0; i < 3; ++i) {
      sample.angular_velocity_rad_s[i] = packet.gyro[i] * rad_s_per_count_;
      sample.specific_force_m_s2[i] = packet.accel[i] * m_s2_per_count_;
    }
    batch.samples.push_back(sample);
  }
  return FetchOutcome::kOk;
}

/// Packets follow each other by one period of the chip's own clock. A stamp that says otherwise was garbled on the bus:
/// there is no checksum. False: several in a row were.
bool Icm42688p::time_of(std::uint16_t timestamp, DeviceStamp& device) noexcept {
  const int step = static_cast<int>(counter_.step_to(timestamp));
  const bool is_strange = counter_.started() && std::abs(step - counts_per_sample_) > counts_per_sample_ / 8 + 2;
  if (is_strange) {
    if (++strange_times_ > 2) return false;
    timestamp = static_cast<std::uint16_t>(counter_.last() + static_cast<std::uint32_t>(counts_per_sample_));
  } else {
    strange_times_ = 0;
  }
  device = {times_15(counter_.advance(timestamp)) / 15};
  return true;
}

}  // namespace epiline
