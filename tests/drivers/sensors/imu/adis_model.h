#pragma once
// Register model of the ADIS16470, written from other public drivers: chip_facts.md.
#include <array>
#include <vector>

#include "tests/drivers/sensors/imu/spi_world.h"

namespace epiline::test {

class AdisModel final : public ChipModel {
 public:
  explicit AdisModel(SpiWorld& in) : ChipModel(in) { power_on(); }

  void power_on() {
    registers_.fill(0);
    reg(0x60) = 0x00C1, reg(0x62) = 0x07D0, reg(0x72) = product;
    dead_until_ns_ = world.now_ns + 200'000'000;
    next_ns_ = dead_until_ns_ + 500'000;
    counter_ = 0;
  }
  std::uint16_t& reg(std::uint8_t address) { return registers_[address / 2]; }

  void run(std::int64_t until_ns) override {
    while (next_ns_ <= until_ns) take(next_ns_);
  }
  std::int64_t next_ns() const override { return next_ns_; }

  std::vector<Truth> truths;
  std::uint16_t product = 16470;
  int resets = 0, too_soon = 0;   ///< words that came before the stall time was over
  std::uint16_t next_status = 0;  ///< DIAG_STAT of the next burst

  void select() {
    bytes_ = 0;
    is_burst_ = false;
    if (world.now_ns - last_word_ns_ < 15'900) ++too_soon;
  }
  void deselect() {
    last_word_ns_ = world.now_ns;
    if (bytes_ % 2 != 0) reg(0x02) |= 1U << 3;
  }
  std::uint8_t exchange(std::uint8_t in, int mode, int hz) {
    if (world.now_ns < dead_until_ns_) return 0;
    const std::size_t at = bytes_++;
    if (at == 2 && word_ == 0x6800) start_burst(hz);
    std::uint8_t out = 0;
    if (is_burst_) {
      out = at - 2 < burst_.size() ? burst_[at - 2] : 0;
    } else {
      out = static_cast<std::uint8_t>(at % 2 == 0 ? answer_ >> 8 : answer_);
      word_ = static_cast<std::uint16_t>(word_ << 8 | in);
      if (at % 2 == 1) execute();
    }
    return mode == 3 ? out : static_cast<std::uint8_t>(out << 1);
  }

 private:
  void take(std::int64_t at_ns) {
    next_ns_ = at_ns + static_cast<std::int64_t>(500'000.0 * (reg(0x64) + 1) / (1 + clock_error));
    ++counter_;
    Truth truth{at_ns, {}, {}};
    for (std::size_t i = 0; i < 3; ++i) {
      gyro_[i] = static_cast<std::int16_t>(world.uniform(-20'000, 20'000));
      accel_[i] = static_cast<std::int16_t>(world.uniform(-32'000, 32'000));
    }
    gyro_[0] = static_cast<std::int16_t>(static_cast<int>(truths.size() % 30'000) - 15'000);
    for (std::size_t i = 0; i < 3; ++i) {
      truth.gyro_rad_s[i] = gyro_[i] * 3.14159265358979 / 180 / 10;  // the kernel: 1 deg/s is 10 counts
      truth.accel_m_s2[i] = accel_[i] * 9.80665 / 800;               // and 1 g is 800
    }
    truths.push_back(truth);
    const bool active_high = (reg(0x60) & 1) != 0;
    give_edge(at_ns + (active_high == line_is_rising ? 0 : 150'000));
  }

  void execute() {
    const auto address = static_cast<std::uint8_t>(word_ >> 8 & 0x7f);
    if ((word_ & 0x8000) == 0) {
      answer_ = registers_[address / 2];
      if (address == 0x02) registers_[1] = 0;
      return;
    }
    const auto value = static_cast<std::uint8_t>(word_);
    std::uint16_t& wanted = registers_[address / 2];
    const bool is_high = address % 2 != 0;
    if (address / 2 == 0x68 / 2) {
      if (!is_high && (value & 0x80) != 0) ++resets, power_on();
      return;
    }
    if (address / 2 == 0x72 / 2) return;
    wanted = static_cast<std::uint16_t>(is_high ? (wanted & 0x00ff) | value << 8 : (wanted & 0xff00) | value);
    if (address / 2 == 0x64 / 2 && is_high)
      next_ns_ = world.now_ns + static_cast<std::int64_t>(500'000.0 * (reg(0x64) + 1) / (1 + clock_error));
  }

  void start_burst(int hz) {
    is_burst_ = true;
    std::size_t at = 0;
    unsigned sum = 0;
    const auto put = [&](int value) {
      burst_[at] = static_cast<std::uint8_t>(value >> 8);
      burst_[at + 1] = static_cast<std::uint8_t>(value);
      sum += burst_[at] + burst_[at + 1];
      at += 2;
    };
    put(next_status | reg(0x02));
    next_status = reg(0x02) = 0;
    for (const std::int16_t value : gyro_) put(value);
    for (const std::int16_t value : accel_) put(value);
    put(314);
    put(counter_);
    burst_[18] = static_cast<std::uint8_t>(sum >> 8);
    burst_[19] = static_cast<std::uint8_t>(sum);
    if (hz > 1'000'000) burst_.fill(0x5a);
  }

  std::array<std::uint16_t, 64> registers_{};
  std::array<std::uint8_t, 20> burst_{};
  std::array<std::int16_t, 3> gyro_{}, accel_{};
  std::uint16_t word_ = 0, answer_ = 0, counter_ = 0;
  std::size_t bytes_ = 0;
  bool is_burst_ = false;
  std::int64_t next_ns_ = kNever, dead_until_ns_ = 0, last_word_ns_ = 0;
};

using AdisBus = ChipBus<AdisModel>;

}  // namespace epiline::test
