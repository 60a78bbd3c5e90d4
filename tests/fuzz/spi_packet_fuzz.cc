// Any bytes as what chips on an SPI bus send: never a crash; no more comes out than went in; and through a whole
// driver, whose bus gives the bytes to every transfer: no hang, and stamps that rise.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <span>

#include "drivers/sensors/imu/adis16470.h"
#include "drivers/sensors/imu/bmi088.h"
#include "drivers/sensors/imu/icm42688p.h"
#include "drivers/sensors/imu/spi_imu.h"

using namespace epiline;

namespace {

/// Time goes on with every question.
class Timing final : public SpiTiming {
 public:
  HostStamp now() noexcept override { return {now_ns += 300'000}; }
  void sleep_until(HostStamp instant) noexcept override { now_ns = std::max(now_ns, instant.ns); }
  std::int64_t now_ns = 1'000'000'000;
};

/// Registers that hold what was written, until the chip has started; then the bytes of the fuzzer, over and over.
class Bus : public SpiBus {
 public:
  explicit Bus(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}
  DeviceTrouble open(int, int) noexcept override { return {}; }
  void close() noexcept override {}
  const char* name() const noexcept override { return "fuzz"; }

 protected:
  bool is_honest() noexcept { return transfers_++ < kHonest || bytes_.empty(); }
  std::uint8_t next() noexcept {
    const std::uint8_t byte = bytes_[at_];
    at_ = (at_ + 1) % bytes_.size();
    return byte;
  }

 private:
  static constexpr std::size_t kHonest = 200;
  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0, transfers_ = 0;
};

/// Address and bytes.
class ByteBus final : public Bus {
 public:
  ByteBus(std::span<const std::uint8_t> bytes, std::uint8_t identity_at, std::uint8_t identity) : Bus(bytes) {
    registers_[0][identity_at] = identity;
    registers_[0][0x2D] = 0x10;
  }
  int transfer(std::span<const SpiPart> parts) noexcept override {
    const bool is_sound = is_honest();
    const std::uint8_t address = parts[0].send[0];
    if ((address & 0x80) == 0) {
      if (address == 0x76) bank_ = parts[0].send[1] % 5;
      registers_[address == 0x76 ? 0 : bank_][address] = parts[0].send[1];
    }
    for (const SpiPart& part : parts) {
      for (std::size_t i = 0; part.receive != nullptr && i < part.size; ++i) {
        const std::size_t at = (address + i) & 0x7f;
        part.receive[i] = is_sound ? registers_[at == 0x76 || at == 0x75 ? 0 : bank_][at] : next();
      }
    }
    return 0;
  }

 private:
  std::uint8_t registers_[5][128] = {};
  std::uint8_t bank_ = 0;
};

/// Words, each answered with the next one.
class WordBus final : public Bus {
 public:
  WordBus(std::span<const std::uint8_t> bytes, std::uint8_t identity_at, std::uint16_t identity) : Bus(bytes) {
    registers_[identity_at] = static_cast<std::uint8_t>(identity);
    registers_[identity_at + 1] = static_cast<std::uint8_t>(identity >> 8);
  }
  int transfer(std::span<const SpiPart> parts) noexcept override {
    const bool is_sound = is_honest();
    for (std::size_t i = 0; i < parts[0].size; ++i) parts[0].receive[i] = is_sound ? answer_[i % 2] : next();
    const std::uint8_t address = parts[0].send[0] & 0x7f;
    if ((parts[0].send[0] & 0x80) != 0) registers_[address] = parts[0].send[1];
    answer_[0] = registers_[address | 1];
    answer_[1] = registers_[address & ~1];
    return 0;
  }

 private:
  std::uint8_t registers_[128] = {};
  std::uint8_t answer_[2] = {};
};

void expect_sense(SpiImu& imu, Timing& timing) {
  if (!imu.open()) return;
  ImuSample samples[4];
  std::int64_t last_ns = INT64_MIN;
  for (int i = 0; i < 200; ++i) {
    std::size_t count = 0;
    const std::int64_t before_ns = timing.now_ns;
    imu.read(samples, count, Span{2'000'000});
    if (count > 4 || timing.now_ns - before_ns > 3'000'000'000) std::abort();
    for (std::size_t k = 0; k < count; ++k) {
      if (samples[k].stamp.ns <= last_ns) std::abort();
      last_ns = samples[k].stamp.ns;
      for (const double value : samples[k].angular_velocity_rad_s)
        if (!(std::abs(value) < 40)) std::abort();
      for (const double value : samples[k].specific_force_m_s2)
        if (!(std::abs(value) < 402)) std::abort();
    }
  }
}

void drive(std::uint8_t which, std::span<const std::uint8_t> bytes) {
  ImuDeviceConfig config;
  config.rate_hz = (which & 0x10) != 0 ? 1000 : 200;
  if ((which & 0x20) != 0) config.gyroscope_range_deg_s = 250;
  auto timing = std::make_shared<Timing>();
  std::unique_ptr<ImuChip> chip;
  switch (which % 3) {
    case 0:
      chip = std::make_unique<Icm42688p>(config, std::make_unique<ByteBus>(bytes, 0x75, 0x47), *timing);
      break;
    case 1:
      chip = std::make_unique<Bmi088>(config, std::make_unique<ByteBus>(bytes, 0x00, 0x0F),
                                      std::make_unique<ByteBus>(bytes, 0x00, 0x1E), *timing);
      break;
    default:
      chip = std::make_unique<Adis16470>(config, std::make_unique<WordBus>(bytes, 0x72, 16470), *timing);
      break;
  }
  SpiImu imu(config, std::move(chip), nullptr, timing);
  expect_sense(imu, *timing);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::span<const std::uint8_t> bytes(data + 1, size - 1);
  for (const IcmPacketKind kind : {IcmPacketKind::kShort, IcmPacketKind::kLong}) {
    IcmPacket packet;
    for (std::size_t at = 0; at + icm_packet_bytes(kind) <= bytes.size(); at += icm_packet_bytes(kind)) {
      if (parse_icm_packet(bytes.subspan(at), kind, packet) != IcmParse::kData) continue;
      for (const std::int32_t value : packet.gyro)
        if (std::abs(value) > 524288) std::abort();
    }
  }
  BmiAccelFrames frames;
  parse_bmi_accel(bytes, frames);
  if (frames.values.size() * 7 > bytes.size()) std::abort();
  AdisBurst burst;
  for (std::size_t at = 0; at + AdisBurst::kBytes <= bytes.size(); at += 2) parse_adis_burst(bytes.subspan(at), burst);
  drive(data[0], bytes);
  return 0;
}
