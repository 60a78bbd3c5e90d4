#include "drivers/sensors/imu/bmi088.h"

#include <cstdlib>

#include "drivers/sensors/trouble.h"
namespace epiline {

namespace {

constexpr ChipLimits kLimits{2000, 24, 2000, 10'000'000};
constexpr int kSpiMode = 0;
constexpr std::int64_t kTick_ns_2 = 78'125;  // two counts of the accelerometer's clock: 39.0625 us each
constexpr Span kAccelQuiet = Span::from_milliseconds(50), kTimeSlack = Span::from_milliseconds(5);
constexpr int kStrangeTimesMost = 5;

// Gyroscope.
constexpr std::uint8_t kGyroId = 0x00, kGyroIdentity = 0x0F, kFifoStatus = 0x0E, kGyroRange = 0x0F, kBandwidth = 0x10,
                       kGyroSoftReset = 0x14, kGyroFifoConfig0 = 0x3D, kGyroFifoConfig1 = 0x3E, kGyroFifoData = 0x3F;
constexpr std::uint8_t kOverrun = 0x80, kFrameCount = 0x7F, kGyroFifoStops = 0x40, kBandwidthBits = 0x0F;
// Accelerometer.
constexpr std::uint8_t kAccelId = 0x00, kAccelIdentity = 0x1E, kFifoLength = 0x24, kAccelFifoData = 0x26,
                       kPowerConf = 0x7C, kPowerControl = 0x7D, kAccelCommand = 0x7E;
constexpr std::uint8_t kSoftReset = 0xB6, kFifoReset = 0xB0, kAccelOn = 0x04;

/// Rates of the gyroscope with the bandwidth that goes with them (section 5.5.5), and of the accelerometer the
/// setting whose bandwidth is next to that and whose rate is not below (section 4.4.1).
struct Rate {
  double hz;
  std::uint8_t bandwidth_code;
  double bandwidth_hz;
  double accel_hz;
  std::uint8_t accel_conf;
  double accel_bandwidth_hz;
  int accel_ticks;
};
constexpr Rate kRates[] = {
    {100, 0x07, 32, 200, 0x99, 38, 128},     // OSR2
    {200, 0x06, 64, 400, 0x9A, 75, 64},      // OSR2
    {400, 0x03, 47, 800, 0x8B, 75, 32},      // OSR4
    {1000, 0x02, 116, 1600, 0x8C, 145, 16},  // OSR4
    {2000, 0x01, 230, 1600, 0xAC, 280, 16},  // normal
};

constexpr double kGyroscopeRanges_deg_s[] = {2000, 1000, 500, 250, 125};
constexpr double kAccelerometerRanges_g[] = {24, 12, 6, 3};  // by 3 - code

constexpr std::size_t kGyroFrame = 6;  // bytes

// Headers without the two lowest bits, which tell of interrupt inputs.
constexpr std::uint8_t kData = 0x84, kSkip = 0x40, kTime = 0x44, kConfig = 0x48, kDrop = 0x50, kEmpty = 0x80;
constexpr std::uint8_t kHeaderBits = 0xFC;

BmiVector vector_at(std::span<const std::uint8_t> bytes, std::size_t at) noexcept {
  const auto value = [&](std::size_t i) { return static_cast<std::int16_t>(bytes[i + 1] << 8 | bytes[i]); };
  return {value(at), value(at + 2), value(at + 4)};
}

std::size_t frame_bytes(std::uint8_t kind) noexcept {
  switch (kind) {
    case kData:
      return 7;
    case kTime:
      return 4;
    case kSkip:
    case kConfig:
    case kDrop:
      return 2;
    default:
      return 0;
  }
}

}  // namespace

bool parse_bmi_accel(std::span<const std::uint8_t> bytes, BmiAccelFrames& frames) noexcept {
  frames.values.clear();
  frames.skipped = 0;
  frames.has_time = false;
  while (!bytes.empty()) {
    const std::uint8_t kind = bytes[0] & kHeaderBits;
    if (kind == kEmpty) return true;
    const std::size_t size = frame_bytes(kind);
    if (size == 0) return false;
    if (size > bytes.size()) return true;  // it comes again, whole
    if (kind == kData && !frames.values.push_back(vector_at(bytes, 1))) return false;
    if (kind == kSkip) {
      frames.skipped += bytes[1];
      frames.values.clear();  // they are not in a row with what follows
    }
    if (kind == kTime) {
      frames.has_time = true;
      frames.time = bytes[1] | static_cast<std::uint32_t>(bytes[2]) << 8 | static_cast<std::uint32_t>(bytes[3]) << 16;
      return true;  // the FIFO is empty
    }
    bytes = bytes.subspan(size);
  }
  return true;
}

Bmi088::Bmi088(const ImuDeviceConfig& config, std::unique_ptr<SpiBus> gyroscope, std::unique_ptr<SpiBus> accelerometer,
               SpiTiming& timing)
    : RegisterChip("BMI088", kLimits, config, timing),
      gyroscope_(std::move(gyroscope)),
      accelerometer_(std::move(accelerometer)) {
  const Rate* rate = std::begin(kRates);
  while (rate + 1 != std::end(kRates) && rate->hz < config.rate_hz * 0.99) ++rate;
  gyroscope_code_ = smallest_range(kGyroscopeRanges_deg_s, config.gyroscope_range_deg_s);
  const int accel_range = smallest_range(kAccelerometerRanges_g, config.accelerometer_range_m_s2 / kGravity_m_s2);
  bandwidth_code_ = rate->bandwidth_code;
  accel_ticks_ = rate->accel_ticks;
  facts_.gyroscope_range_deg_s = kGyroscopeRanges_deg_s[gyroscope_code_];
  facts_.accelerometer_range_g = kAccelerometerRanges_g[accel_range];
  rad_s_per_count_ = facts_.gyroscope_range_deg_s / 32768 * kRadPerDeg;
  m_s2_per_count_ = facts_.accelerometer_range_g / 32768 * kGravity_m_s2;
  facts_.rate_hz = rate->hz;
  facts_.period = Span::from_seconds(1 / rate->hz);
  facts_.accelerometer_period = Span::from_seconds(1 / rate->accel_hz);
  // the data sheet gives bandwidths and no delays
  facts_.gyroscope_delay = Span::from_seconds(second_order_delay_s(rate->bandwidth_hz));
  facts_.accelerometer_delay = Span::from_seconds(second_order_delay_s(rate->accel_bandwidth_hz));
  facts_.settle = Span{4 * facts_.gyroscope_delay.ns} + Span::from_milliseconds(10);
  facts_.two_clocks = true;

  // In the order in which they are written; the accelerometer is on by then.
  const std::uint8_t level = config.ready_edge == 0 ? 0x01 : 0x00;
  set_table({
      {kAccelerometer, kPowerConf, 0x00, 0xFF},
      {kAccelerometer, kPowerControl, kAccelOn, 0xFF},
      {kAccelerometer, 0x40, rate->accel_conf, 0xFF},
      {kAccelerometer, 0x41, static_cast<std::uint8_t>(3 - accel_range), 0x03},
      {kAccelerometer, 0x48, 0x02, 0x03},  // FIFO: the newest stay; bit 1 is always 1
      {kAccelerometer, 0x49, 0x50, 0x5C},  // acceleration into the FIFO, interrupt inputs not; bit 4 is always 1
      {kGyroscope, kGyroRange, gyroscope_code_, 0xFF},
      {kGyroscope, kBandwidth, bandwidth_code_, kBandwidthBits},
      {kGyroscope, 0x11, 0x00, 0xA0},   // normal power
      {kGyroscope, 0x16, level, 0x03},  // INT3: push-pull, active high or low
      {kGyroscope, 0x18, 0x01, 0x85},   // INT3: new data
      {kGyroscope, 0x15, 0x80, 0xC0},   // interrupt on new data
      {kGyroscope, 0x1E, 0x08, 0x88},   // no interrupt on the FIFO's level
      {kGyroscope, kGyroFifoConfig1, kGyroFifoStops, 0xC0},
  });
}

// ---- registers ----

bool Bmi088::read(unsigned half, std::uint8_t address, std::span<std::uint8_t> bytes) noexcept {
  // the accelerometer sends a byte without meaning first
  bus_error_ =
      half == kAccelerometer ? accelerometer_->read_bytes(address, bytes, 1) : gyroscope_->read_bytes(address, bytes);
  return bus_error_ == 0;
}

bool Bmi088::write(unsigned half, std::uint8_t address, std::uint8_t value) noexcept {
  // between writes the chip wants 2 us; the system call takes longer
  bus_error_ = (half == kAccelerometer ? accelerometer_ : gyroscope_)->write_byte(address, value);
  return bus_error_ == 0;
}

DeviceTrouble Bmi088::open() noexcept {
  if (const DeviceTrouble trouble = gyroscope_->open(kSpiMode, spi_hz_)) return trouble;
  if (const DeviceTrouble trouble = accelerometer_->open(kSpiMode, spi_hz_)) return trouble;
  return identify();
}

void Bmi088::close() noexcept {
  gyroscope_->close();
  accelerometer_->close();
}

DeviceTrouble Bmi088::identify() noexcept {
  std::array<std::uint8_t, 2> gyro{};
  std::array<std::uint8_t, 1> accel{};
  // after power-on the accelerometer uses I2C until its chip select has risen once; and the devices may be swapped
  const bool is_read = read(kAccelerometer, kAccelId, accel) && read(kGyroscope, kGyroId, gyro) &&
                       read(kAccelerometer, kAccelId, accel) && read(kGyroscope, kGyroId, gyro);
  if (!is_read) return device_refusal("CHIP_ID", bus_error_);
  // the gyroscope sends no dummy byte, so the accelerometer's identity is in the second byte
  if (gyro[0] != kGyroIdentity && gyro[1] == kAccelIdentity) {
    return unexpected("identity register", "imu.device and imu.device_accel swapped",
                      "the accelerometer answers instead of the gyroscope");
  }
  DeviceTrouble trouble;
  if (gyro[0] != kGyroIdentity) {
    trouble = wrong_identity(gyro[0], kGyroIdentity);
    trouble.step = "identity register of the gyroscope";
  } else if (accel[0] != kAccelIdentity) {
    trouble = wrong_identity(accel[0], kAccelIdentity);
    trouble.step = "identity register of the accelerometer";
  }
  return trouble;
}

ImuChip::Step Bmi088::start(int step) noexcept {
  switch (step) {
    case 0:
      if (!write(kGyroscope, kGyroSoftReset, kSoftReset) || !write(kAccelerometer, kAccelCommand, kSoftReset))
        return {.trouble = device_refusal("reset", bus_error_)};
      return {.wait = Span::from_milliseconds(35)};  // the gyroscope takes 30 ms, the accelerometer 1 ms
    case 1:
      if (const DeviceTrouble trouble = identify()) return {.trouble = trouble};
      if (!write(kAccelerometer, kPowerConf, 0)) return {.trouble = device_refusal("power", bus_error_)};
      return {.wait = Span::from_milliseconds(5)};
    case 2:
      if (!write(kAccelerometer, kPowerControl, kAccelOn)) return {.trouble = device_refusal("power", bus_error_)};
      return {.wait = Span::from_milliseconds(5)};  // 0.45 ms by the data sheet
    case 3:
      return {.trouble = configure(), .wait = Span::from_milliseconds(2)};
    default:
      if (flush(FetchOutcome::kOk) != FetchOutcome::kOk) return {.trouble = device_refusal("FIFO", bus_error_)};
      next_check_ = 0;
      counter_.restart();
      strange_times_ = 0;
      last_accel_ = timing_->now();
      return {.done = true};
  }
}

bool Bmi088::read_register(const Register& at, std::uint16_t& value) noexcept {
  std::uint8_t byte = 0;
  const bool is_read = read(at.bank, at.address, {&byte, 1});
  value = byte;
  return is_read;
}

bool Bmi088::write_register(const Register& at, std::uint16_t value) noexcept {
  return write(at.bank, at.address, static_cast<std::uint8_t>(value));
}

DeviceTrouble Bmi088::mismatch(const Register& wanted, unsigned found) const noexcept {
  const char* const half = wanted.bank == kAccelerometer ? "accelerometer" : "gyroscope";
  return wrong_register(half, 0, wanted.address, found, wanted.value);
}

// ---- samples ----

bool Bmi088::flush_gyroscope() noexcept {
  gyro_samples_ = 0;
  // writing either clears it; the second one its overrun as well
  return write(kGyroscope, kGyroFifoConfig0, 0) && write(kGyroscope, kGyroFifoConfig1, kGyroFifoStops);
}

bool Bmi088::flush_accelerometer() noexcept {
  next_accel_count_ = -1;
  return write(kAccelerometer, kAccelCommand, kFifoReset);
}

FetchOutcome Bmi088::flush(FetchOutcome outcome) noexcept {
  return flush_accelerometer() && flush_gyroscope() ? outcome : FetchOutcome::kBusFailed;
}

FetchOutcome Bmi088::fetch(ChipBatch& batch) noexcept {
  const FetchOutcome outcome = fetch_gyroscope(batch);
  if (outcome != FetchOutcome::kOk || batch.samples.empty()) return outcome;
  const FetchOutcome of_accelerometer = fetch_accelerometer(batch);
  const HostStamp now = timing_->now();
  if (!batch.accels.empty()) last_accel_ = now;
  const bool is_quiet = now - last_accel_ > kAccelQuiet + Span{8 * facts_.accelerometer_period.ns};
  return of_accelerometer == FetchOutcome::kOk && is_quiet ? FetchOutcome::kReset : of_accelerometer;
}

FetchOutcome Bmi088::fetch_gyroscope(ChipBatch& batch) noexcept {
  std::array<std::uint8_t, 3> head{};  // FIFO_STATUS, and by the way GYRO_RANGE and GYRO_BANDWIDTH
  if (!read(kGyroscope, kFifoStatus, head)) return FetchOutcome::kBusFailed;
  batch.latched = timing_->now();
  if (head[1] != gyroscope_code_ || (head[2] & kBandwidthBits) != bandwidth_code_) {
    ++batch.damaged;  // if those two are well when they are read alone
    const Register shown[] = {{kGyroscope, kGyroRange, gyroscope_code_, 0xFF},
                              {kGyroscope, kBandwidth, bandwidth_code_, kBandwidthBits}};
    return judge(shown);
  }
  const std::size_t count = head[0] & kFrameCount;
  if ((head[0] & kOverrun) != 0 || count * kGyroFrame >= kGyroFifoBytes) {
    batch.lost += static_cast<std::uint32_t>(count);
    return flush(FetchOutcome::kOverflow);
  }
  if (count == 0) return FetchOutcome::kOk;
  const std::span<std::uint8_t> bytes(received_.data(), count * kGyroFrame);
  if (!read(kGyroscope, kGyroFifoData, bytes)) return FetchOutcome::kBusFailed;
  for (std::size_t i = 0; i < count; ++i) {
    const BmiVector value = vector_at(bytes, i * kGyroFrame);
    ChipSample sample;
    sample.device = {gyro_samples_++ * facts_.period.ns};
    for (std::size_t k = 0; k < 3; ++k) sample.angular_velocity_rad_s[k] = value[k] * rad_s_per_count_;
    batch.samples.push_back(sample);
  }
  return FetchOutcome::kOk;
}

FetchOutcome Bmi088::fetch_accelerometer(ChipBatch& batch) noexcept {
  std::array<std::uint8_t, 2> length{};
  if (!read(kAccelerometer, kFifoLength, length)) return FetchOutcome::kBusFailed;
  const std::size_t bytes = static_cast<std::size_t>(length[0] | (length[1] & 0x3F) << 8);
  if (bytes > kAccelFifoBytes) {  // a dead line
    ++batch.damaged;
    return flush_accelerometer() ? FetchOutcome::kOk : FetchOutcome::kBusFailed;
  }
  if (bytes == 0) return FetchOutcome::kOk;
  const std::span<std::uint8_t> received(received_.data(), bytes + kMoreBytes);
  if (!read(kAccelerometer, kAccelFifoData, received)) return FetchOutcome::kBusFailed;
  batch.accel_latched = timing_->now();
  if (!parse_bmi_accel(received, frames_)) {
    ++batch.damaged;
    return flush_accelerometer() ? FetchOutcome::kOk : FetchOutcome::kBusFailed;
  }
  batch.lost += frames_.skipped;
  if (frames_.has_time && !is_plausible(frames_.time, batch.accel_latched)) {
    ++batch.damaged;
    frames_.has_time = false;
    if (++strange_times_ > kStrangeTimesMost) return FetchOutcome::kReset;
  }
  place_accels(batch);
  return FetchOutcome::kOk;
}

/// The counter went on as the time did; otherwise it was garbled on the bus.
bool Bmi088::is_plausible(std::uint32_t time, HostStamp latched) noexcept {
  const Span elapsed = latched - last_time_;
  const std::int64_t step_ns = counter_.step_to(time) * kTick_ns_2 / 2;
  const bool is_strange = counter_.started() && std::abs(step_ns - elapsed.ns) > elapsed.ns / 16 + kTimeSlack.ns;
  if (is_strange) return false;
  strange_times_ = 0;
  last_time_ = latched;
  return true;
}

/// The accelerometer takes a sample whenever the low bits of its counter are 0. So the newest sample's time is the
/// counter's without them; and as long as none is lost each is one period after the one before.
void Bmi088::place_accels(ChipBatch& batch) noexcept {
  const auto n = static_cast<std::int64_t>(frames_.values.size());
  if (frames_.has_time) {
    if (!counter_.started()) count_offset_ = frames_.time;
    const std::int64_t count = counter_.advance(frames_.time) + count_offset_;
    batch.accel_now = {count * kTick_ns_2 / 2};
    batch.has_accel_now = true;
    const std::int64_t newest = count - count % accel_ticks_;
    next_accel_count_ = newest - (n - 1) * accel_ticks_;
  }
  if (frames_.skipped > 0 && !frames_.has_time) next_accel_count_ = -1;
  if (next_accel_count_ < 0) return;  // nobody knows
  for (const BmiVector& value : frames_.values) {
    ChipAccel accel;
    accel.device = {next_accel_count_ * kTick_ns_2 / 2};
    next_accel_count_ += accel_ticks_;
    for (std::size_t k = 0; k < 3; ++k) accel.specific_force_m_s2[k] = value[k] * m_s2_per_count_;
    batch.accels.push_back(accel);
  }
}

}  // namespace epiline
