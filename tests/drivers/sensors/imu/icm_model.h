#pragma once
// Register model of the ICM-42688-P, written from the vendor's and other public drivers: chip_facts.md.
#include <array>
#include <vector>

#include "tests/drivers/sensors/imu/spi_world.h"

namespace epiline::test {

class IcmModel final : public ChipModel {
 public:
  explicit IcmModel(SpiWorld& in) : ChipModel(in) { power_on(); }

  /// Also what a supply that dips does.
  void power_on() {
    for (auto& bank : banks_) bank.fill(0);
    banks_[0][0x13] = 0x05, banks_[0][0x2D] = 0x10, banks_[0][0x4C] = 0x30, banks_[0][0x4D] = 0x91;
    banks_[0][0x4F] = banks_[0][0x50] = 0x06, banks_[0][0x51] = 0x16, banks_[0][0x52] = 0x11, banks_[0][0x53] = 0x0D;
    banks_[0][0x54] = 0x23, banks_[0][0x64] = banks_[0][0x65] = 0x10, banks_[0][0x75] = who_am_i;
    banks_[1][0x0B] = 0xA0, banks_[1][0x0C] = 0x0D, banks_[1][0x0D] = 0xAA, banks_[1][0x0E] = 0x80;
    banks_[2][0x03] = 0x30, banks_[2][0x04] = 0x40, banks_[2][0x05] = 0x62;
    fifo_.clear();
    bank_ = 0;
    next_ns_ = kNever;
    boot_ns_ = world.now_ns;
  }

  void run(std::int64_t until_ns) override {
    while (next_ns_ <= until_ns) take(next_ns_);
  }
  std::int64_t next_ns() const override { return next_ns_; }

  std::uint8_t& reg(int bank, std::uint8_t address) { return banks_[static_cast<std::size_t>(bank)][address]; }
  std::uint64_t overflows = 0;
  std::vector<Truth> truths;  ///< of all samples since power was on first; the index is in gyro x
  std::uint8_t who_am_i = 0x47;
  double pll_scale = 32.0 / 30;
  int resets = 0;
  bool garbles_next_time = false;  ///< one bit of a packet's time stamp

  // The wires.
  void select() {
    position_ = 0;
    popped_ = offset_ = 0;
  }
  void deselect() { fifo_.erase(fifo_.begin(), fifo_.begin() + static_cast<std::ptrdiff_t>(popped_)); }
  std::uint8_t exchange(std::uint8_t in, int mode, int hz) {
    if (mode != 0 && mode != 3) in = static_cast<std::uint8_t>(in << 1);  // sampled at the other edge
    std::uint8_t out = 0;
    if (position_ == 0) {
      address_ = in & 0x7f;
      is_read_ = (in & 0x80) != 0;
    } else if (is_read_) {
      out = read();
    } else {
      write(in);
    }
    ++position_;
    return hz > 24'000'000 ? static_cast<std::uint8_t>(out << 1) : out;
  }

 private:
  /// The vendor's driver and PX4: with the PLL, and without a clock from outside, a count lasts 32/30 of the figure.
  double count_scale() const {
    const bool has_pll = (banks_[0][0x4D] & 0x03) == 0x01, is_external = (banks_[0][0x4D] & 0x04) != 0;
    return has_pll && !is_external ? pll_scale : 1;
  }
  std::size_t packet_bytes() const { return (banks_[0][0x5F] & 0x10) != 0 ? 20 : 16; }

  static double rate_of(std::uint8_t code) {
    constexpr double kRates[16] = {0, 0, 0, 8000, 4000, 2000, 1000, 200, 100, 50, 25, 12.5, 0, 0, 0, 500};
    return kRates[code & 0x0f];
  }

  std::int64_t period_ns() const {
    return static_cast<std::int64_t>(1e9 / rate_of(banks_[0][0x4F]) / (1 + clock_error));
  }

  void take(std::int64_t at_ns) {
    next_ns_ = at_ns + period_ns();
    const auto& bank = banks_[0];
    const bool fifo_on = (bank[0x16] & 0xC0) != 0 && (bank[0x5F] & 0x03) == 0x03;
    if (!fifo_on) return;
    const bool hires = (bank[0x5F] & 0x10) != 0;
    const bool started = at_ns - on_ns_ > 30'000'000;
    const bool same_rate = (bank[0x4F] & 0x0f) == (bank[0x50] & 0x0f);
    std::int32_t gyro[3], accel[3];
    values(hires, gyro, accel);
    // the kernel: rad/s per count at 16 bit, from 2000 deg/s down, halving; m/s^2 from 16 g down
    const int gyro_code = hires ? 0 : bank[0x4F] >> 5, accel_code = hires ? 0 : bank[0x50] >> 5;
    const double gyro_scale = 0.001065264436032 / (1 << gyro_code) / (hires ? 16 : 1);
    const double accel_scale = 0.00478840332031 / (1 << accel_code) / (hires ? 16 : 1);
    if (fifo_.size() + 1 >= 2048 / packet_bytes()) {
      banks_[0][0x2D] |= 0x02;
      ++overflows;
      return;  // stop on full
    }
    Truth truth{at_ns, {}, {}};
    for (int i = 0; i < 3; ++i)
      truth.gyro_rad_s[i] = gyro[i] * gyro_scale, truth.accel_m_s2[i] = accel[i] * accel_scale;
    if (!started || !same_rate) gyro[0] = gyro[1] = gyro[2] = hires ? -524288 : -32768;
    truths.push_back(truth);

    const double us = static_cast<double>(at_ns - boot_ns_) * 1e-3 * (1 + clock_error);
    const double us_per_tick = count_scale() * ((bank[0x54] & 0x08) != 0 ? 16 : 1);
    auto ticks = static_cast<std::uint64_t>(us / us_per_tick);
    if (garbles_next_time) ticks ^= 0x2000;
    garbles_next_time = false;
    std::array<std::uint8_t, 20> p{};
    p[0] = hires ? 0x78 : 0x68;
    const auto put = [&p](std::size_t at, auto value) {
      p[at] = static_cast<std::uint8_t>(value >> 8);
      p[at + 1] = static_cast<std::uint8_t>(value);
    };
    for (std::size_t i = 0; i < 3; ++i) {
      put(1 + 2 * i, hires ? accel[i] >> 4 : accel[i]);
      put(7 + 2 * i, hires ? gyro[i] >> 4 : gyro[i]);
      if (hires) p[17 + i] = static_cast<std::uint8_t>((accel[i] & 15) << 4 | (gyro[i] & 15));
    }
    p[13] = static_cast<std::uint8_t>(std::lround((31.0 - 25) * 2.07));
    if (hires) put(13, std::lround((31.0 - 25) * 132.48));
    put(hires ? 15 : 14, ticks);
    fifo_.push_back(p);

    const bool threshold = (bank[0x65] & 0x04) != 0 && (bank[0x5F] & 0x20) != 0 && bank[0x60] != 0;
    const bool ready = (bank[0x65] & 0x08) != 0;
    if ((bank[0x64] & 0x10) == 0 && (bank[0x14] & 0x02) != 0 && (threshold || ready)) {
      const bool active_high = (bank[0x14] & 0x01) != 0;
      give_edge(at_ns + (active_high == line_is_rising ? 0 : 100'000));  // the pulse's other end
    }
  }

  /// Gyro x counts the samples, the rest is random.
  void values(bool hires, std::int32_t* gyro, std::int32_t* accel) {
    for (int i = 0; i < 3; ++i) {
      const int most = hires ? 500'000 : 32'000;
      gyro[i] = static_cast<std::int32_t>(world.uniform(-most, most));
      accel[i] = static_cast<std::int32_t>(world.uniform(-most, most));
      if (hires) gyro[i] &= ~1, accel[i] &= ~3;
    }
    const auto n = static_cast<std::int32_t>(truths.size() % 30'000);
    gyro[0] = (n - 15'000) * (hires ? 16 : 1);
  }

  std::uint8_t read() {
    if (address_ == 0x76) return bank_;
    if (bank_ == 0 && address_ == 0x30) return read_fifo();
    std::uint8_t value = banks_[bank_][address_];
    if (bank_ == 0 && address_ == 0x2D) banks_[0][0x2D] = 0;
    if (bank_ == 0 && (address_ == 0x2E || address_ == 0x2F)) {
      std::size_t count = fifo_.size();
      if ((banks_[0][0x4C] & 0x40) == 0) count *= packet_bytes();
      if (address_ == 0x2E) latched_count_ = count;
      const bool high = (address_ == 0x2E) == ((banks_[0][0x4C] & 0x20) != 0);
      value = static_cast<std::uint8_t>(high ? latched_count_ >> 8 : latched_count_);
    }
    address_ = (address_ + 1) & 0x7f;
    return value;
  }

  std::uint8_t read_fifo() {
    if (popped_ >= fifo_.size()) return 0xff;
    const std::uint8_t value = fifo_[popped_][offset_];
    if (++offset_ == packet_bytes()) ++popped_, offset_ = 0;  // what was read in part comes again
    return value;
  }

  void write(std::uint8_t value) {
    if (address_ == 0x76) {
      bank_ = value & 0x07;
      if (bank_ > 4) bank_ = 0;
    } else if (bank_ == 0 && address_ == 0x11) {
      if ((value & 0x01) != 0) ++resets, power_on();
    } else if (bank_ == 0 && address_ == 0x4B) {
      if ((value & 0x02) != 0) fifo_.clear();
    } else if (!(bank_ == 0 && (address_ == 0x75 || (address_ >= 0x1D && address_ <= 0x30)))) {
      banks_[bank_][address_] = value;
      if (bank_ == 0 && address_ == 0x4E) power();
    }
    address_ = (address_ + 1) & 0x7f;
  }

  void power() {
    const bool on = (banks_[0][0x4E] & 0x0f) == 0x0f && rate_of(banks_[0][0x4F]) > 0;
    if (on && next_ns_ == kNever) {
      on_ns_ = world.now_ns;
      next_ns_ = world.now_ns + period_ns() + static_cast<std::int64_t>(world.uniform(0, 1e6));
    }
    if (!on) next_ns_ = kNever;
  }

  std::array<std::array<std::uint8_t, 128>, 5> banks_{};
  std::uint8_t bank_ = 0, address_ = 0;
  bool is_read_ = false;
  std::size_t position_ = 0, popped_ = 0, offset_ = 0, latched_count_ = 0;
  std::deque<std::array<std::uint8_t, 20>> fifo_;
  std::int64_t next_ns_ = kNever, boot_ns_ = 0, on_ns_ = 0;
};

using IcmBus = ChipBus<IcmModel>;

}  // namespace epiline::test
