#pragma once
// Register model of the BMI088, written from other public drivers: chip_facts.md.
#include <array>
#include <vector>

#include "tests/drivers/sensors/imu/spi_world.h"

namespace epiline::test {

class BmiModel final : public ChipModel {
 public:
  explicit BmiModel(SpiWorld& in) : ChipModel(in) { power_on(); }

  void power_on() {
    reset_gyro(world.now_ns);
    reset_accel();
    accel_is_spi_ = false;
    accel_boot_ns_ = world.now_ns - static_cast<std::int64_t>(world.uniform(0, 600e9));  // the counter shows anything
  }

  void run(std::int64_t until_ns) override {
    for (;;) {
      const std::int64_t at_ns = std::min(gyro_next_ns_, accel_next_ns_);
      if (at_ns > until_ns) return;
      gyro_next_ns_ == at_ns ? take_gyro(at_ns) : take_accel(at_ns);
    }
  }
  /// The line is the gyroscope's.
  std::int64_t next_ns() const override { return gyro_next_ns_; }

  /// A smooth motion, at most 16 m/s^3, m/s^2.
  static double acceleration(std::int64_t at_ns, int axis) {
    const double phase = std::fmod(static_cast<double>(at_ns) * 1e-9 + 0.3 * axis, 4.0);
    return 10 * std::sin(phase * 3.14159265358979 / 2);
  }

  std::vector<Truth> truths;
  std::int64_t gyro_delay_ns = 0, accel_delay_ns = 0;  ///< of the filters: what a sample shows is as old
  double accel_clock_error = 0;
  int resets = 0;
  std::uint64_t gyro_overflows = 0, accel_overflows = 0;
  std::uint8_t& gyro_reg(std::uint8_t address) { return gyro_[address]; }
  std::uint8_t& accel_reg(std::uint8_t address) { return accel_[address]; }
  void lose_accel() { reset_accel(), accel_is_spi_ = false; }

  // The wires, one half each.
  struct Wires {
    std::size_t position = 0;
    std::uint8_t address = 0;
    bool is_read = false;
  };
  void select_gyro() { gyro_wires_ = {}; }
  std::uint8_t exchange_gyro(std::uint8_t in) {
    Wires& w = gyro_wires_;
    std::uint8_t out = 0;
    if (w.position++ == 0) {
      w.address = in & 0x7f;
      w.is_read = (in & 0x80) != 0;
    } else if (w.is_read) {
      out = read_gyro(w.address);
      if (w.address != 0x3F) w.address = (w.address + 1) & 0x7f;
    } else {
      write_gyro(w.address, in);
      w.address = (w.address + 1) & 0x7f;
    }
    return out;
  }
  void select_accel() {
    accel_wires_ = {};
    stream_.clear();
    stream_at_ = stream_popped_ = 0;
  }
  void deselect_accel() {
    accel_is_spi_ = true;  // the rising edge
    // whole frames that were read are gone
    std::size_t frames = 0, end = skipped_sent_ ? 2 : 0;
    while (frames < accel_fifo_.size() + stream_popped_ && end + 7 <= stream_at_) end += 7, ++frames;
    frames -= std::min(frames, stream_popped_);
    if (!stream_.empty()) {
      accel_fifo_.erase(accel_fifo_.begin(), accel_fifo_.begin() + static_cast<std::ptrdiff_t>(frames));
      if (skipped_sent_ && stream_at_ >= 2) accel_skipped_ = 0;
    }
  }
  std::uint8_t exchange_accel(std::uint8_t in) {
    Wires& w = accel_wires_;
    const std::size_t position = w.position++;
    if (position == 0) {
      w.address = in & 0x7f;
      w.is_read = (in & 0x80) != 0;
      return 0;
    }
    if (!accel_is_spi_) return 0xff;
    if (!w.is_read) {
      write_accel(w.address, in);
      return 0;
    }
    if (position == 1) return 0xa5;  // the byte without meaning
    if (w.address == 0x26) return read_accel_fifo();
    const std::uint8_t out = read_accel(w.address);
    w.address = (w.address + 1) & 0x7f;
    return out;
  }

 private:
  void reset_gyro(std::int64_t now_ns) {
    gyro_.fill(0);
    gyro_[0x00] = 0x0F, gyro_[0x10] = 0x80, gyro_[0x16] = 0x0F, gyro_[0x1E] = 0x08;
    gyro_fifo_.clear();
    gyro_overrun_ = false;
    gyro_next_ns_ = now_ns + 30'000'000;
  }
  void reset_accel() {
    accel_.fill(0);
    accel_[0x00] = 0x1E, accel_[0x40] = 0xA8, accel_[0x41] = 0x01, accel_[0x45] = 0x80, accel_[0x48] = 0x02;
    accel_[0x49] = 0x10, accel_[0x7C] = 0x03;
    accel_fifo_.clear();
    accel_skipped_ = 0;
    accel_next_ns_ = kNever;
  }

  double gyro_rate() const {
    constexpr double kRates[16] = {2000, 2000, 1000, 400, 200, 100, 200, 100, 100, 100, 100, 100, 100, 100, 100, 100};
    return kRates[gyro_[0x10] & 0x0f];
  }
  void take_gyro(std::int64_t at_ns) {
    gyro_next_ns_ = at_ns + static_cast<std::int64_t>(1e9 / gyro_rate() / (1 + clock_error));
    if ((gyro_[0x3E] & 0xC0) == 0 || gyro_[0x11] != 0) return;
    Truth truth{at_ns, {}, {}};
    std::array<std::int16_t, 3> raw{};
    for (int i = 0; i < 3; ++i)
      raw[static_cast<std::size_t>(i)] = static_cast<std::int16_t>(world.uniform(-32'000, 32'000));
    raw[0] = static_cast<std::int16_t>(static_cast<int>(truths.size() % 30'000) - 15'000);
    // the kernel's bmg160: 0.001065 rad/s a count at 2000 deg/s
    const double scale = 2000.0 / (1 << gyro_[0x0F]) * 3.14159265358979 / 180 / 32768;
    for (std::size_t i = 0; i < 3; ++i) {
      truth.gyro_rad_s[i] = raw[i] * scale;
      truth.accel_m_s2[i] = acceleration(at_ns - gyro_delay_ns, static_cast<int>(i));
    }
    if (gyro_fifo_.size() >= 100) {
      gyro_overrun_ = true;
      ++gyro_overflows;
    } else {
      truths.push_back(truth);
      gyro_fifo_.push_back(raw);
    }
    const bool push_pull = (gyro_[0x16] & 0x02) == 0;
    if ((gyro_[0x15] & 0x80) != 0 && (gyro_[0x18] & 0x01) != 0 && push_pull) {
      const bool active_high = (gyro_[0x16] & 0x01) != 0;
      give_edge(at_ns + (active_high == line_is_rising ? 0 : 300'000));
    }
  }

  std::uint32_t sensortime(std::int64_t at_ns) const {
    const double us = static_cast<double>(at_ns - accel_boot_ns_) * 1e-3 * (1 + accel_clock_error);
    return static_cast<std::uint32_t>(static_cast<std::uint64_t>(us / 39.0625) & 0xffffff);
  }
  std::uint32_t accel_ticks() const { return 16U << (12 - (accel_[0x40] & 0x0f)); }
  /// When the counter's low bits turn 0 next.
  std::int64_t next_turn(std::int64_t after_ns) const {
    const double tick_ns = 39'062.5 / (1 + accel_clock_error);
    const double ticks = static_cast<double>(after_ns - accel_boot_ns_) / tick_ns;
    const double period = accel_ticks();
    return accel_boot_ns_ + static_cast<std::int64_t>(std::ceil((std::floor(ticks / period) + 1) * period * tick_ns));
  }
  void take_accel(std::int64_t at_ns) {
    accel_next_ns_ = next_turn(at_ns + 1'000);
    if ((accel_[0x49] & 0x40) == 0) return;
    std::array<std::int16_t, 3> raw{};
    const double scale = 9.80665 * 1.5 * (2 << accel_[0x41]) / 32768;  // PX4
    for (int i = 0; i < 3; ++i)
      raw[static_cast<std::size_t>(i)] =
          static_cast<std::int16_t>(std::lround(acceleration(at_ns - accel_delay_ns, i) / scale));
    accel_fifo_.push_back(raw);
    if (accel_fifo_.size() * 7 > 1024) {
      accel_fifo_.pop_front();
      if (stream_frames_ > 0 && !stream_.empty()) {  // it is on its way out just now
        --stream_frames_, ++stream_popped_;
      } else {
        ++accel_skipped_;
        ++accel_overflows;
      }
    }
  }

  std::uint8_t read_gyro(std::uint8_t address) {
    if (address == 0x0E) return static_cast<std::uint8_t>((gyro_overrun_ ? 0x80 : 0) | gyro_fifo_.size());
    if (address == 0x3F) {
      if (gyro_fifo_.empty()) return 0;
      const std::size_t byte = gyro_byte_++;
      const auto value = static_cast<std::uint16_t>(gyro_fifo_.front()[byte / 2]);
      if (gyro_byte_ == 6) gyro_fifo_.pop_front(), gyro_byte_ = 0;
      return static_cast<std::uint8_t>(byte % 2 == 0 ? value : value >> 8);
    }
    return gyro_[address];
  }
  void write_gyro(std::uint8_t address, std::uint8_t value) {
    if (address == 0x14) {
      if (value == 0xB6) ++resets, reset_gyro(world.now_ns);
      return;
    }
    if (address == 0x3D || address == 0x3E) {
      gyro_fifo_.clear();
      gyro_byte_ = 0;
      if (address == 0x3E) gyro_overrun_ = false;
    }
    gyro_[address] = address == 0x10 ? value | 0x80 : value;
  }
  std::uint8_t read_accel(std::uint8_t address) {
    const std::size_t length = accel_fifo_.size() * 7;
    if (address == 0x24) return static_cast<std::uint8_t>(length);
    if (address == 0x25) return static_cast<std::uint8_t>(length >> 8);
    return accel_[address];
  }
  std::uint8_t read_accel_fifo() {
    if (stream_.empty()) {
      skipped_sent_ = accel_skipped_ > 0;
      if (skipped_sent_) stream_ = {0x40, static_cast<std::uint8_t>(std::min<std::uint64_t>(accel_skipped_, 255))};
      stream_frames_ = 0;
    }
    if (stream_at_ >= stream_.size()) {
      if (stream_frames_ < accel_fifo_.size()) {
        stream_.push_back(0x84);
        for (const std::int16_t value : accel_fifo_[stream_frames_]) {
          stream_.push_back(static_cast<std::uint8_t>(value));
          stream_.push_back(static_cast<std::uint8_t>(value >> 8));
        }
        ++stream_frames_;
      } else if (!stream_.empty() && (stream_.size() < 4 || stream_[stream_.size() - 4] != 0x44)) {
        const std::uint32_t time = sensortime(world.now_ns);
        for (const std::uint32_t byte : {0x44U, time, time >> 8, time >> 16})
          stream_.push_back(static_cast<std::uint8_t>(byte));
      } else {
        stream_.push_back(0x80);
      }
    }
    return stream_[stream_at_++];
  }
  void write_accel(std::uint8_t address, std::uint8_t value) {
    if (address == 0x7E) {
      if (value == 0xB6) ++resets, reset_accel(), accel_is_spi_ = false;
      if (value == 0xB0) accel_fifo_.clear(), accel_skipped_ = 0;
      return;
    }
    const bool is_suspended = accel_[0x7C] == 0x03;
    if (is_suspended && address != 0x7C && address != 0x7D) return;
    accel_[address] = value;
    if (address == 0x7D || address == 0x40)
      accel_next_ns_ = accel_[0x7D] == 0x04 ? next_turn(world.now_ns + 1'000'000) : kNever;
  }

  std::array<std::uint8_t, 128> gyro_{}, accel_{};
  Wires gyro_wires_, accel_wires_;
  bool accel_is_spi_ = false, gyro_overrun_ = false, skipped_sent_ = false;
  std::deque<std::array<std::int16_t, 3>> gyro_fifo_, accel_fifo_;
  std::size_t gyro_byte_ = 0, stream_at_ = 0, stream_frames_ = 0, stream_popped_ = 0;
  std::vector<std::uint8_t> stream_;
  std::uint64_t accel_skipped_ = 0;
  std::int64_t gyro_next_ns_ = kNever, accel_next_ns_ = kNever, accel_boot_ns_ = 0;
};

class BmiGyroBus final : public ModelBus {
 public:
  explicit BmiGyroBus(BmiModel& chip) : ModelBus(chip), model_(chip) {}

 private:
  void select() override { model_.select_gyro(); }
  std::uint8_t exchange(std::uint8_t in, int) override { return model_.exchange_gyro(in); }
  BmiModel& model_;
};

class BmiAccelBus final : public ModelBus {
 public:
  explicit BmiAccelBus(BmiModel& chip) : ModelBus(chip), model_(chip) {}

 private:
  void select() override { model_.select_accel(); }
  void deselect() override { model_.deselect_accel(); }
  std::uint8_t exchange(std::uint8_t in, int) override { return model_.exchange_accel(in); }
  BmiModel& model_;
};

}  // namespace epiline::test
