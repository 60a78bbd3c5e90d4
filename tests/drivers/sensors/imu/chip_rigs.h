#pragma once
// Each chip's driver on its model, and what tests of all chips must know of it.
#include <utility>
#include <vector>

#include "drivers/sensors/imu/adis16470.h"
#include "drivers/sensors/imu/bmi088.h"
#include "drivers/sensors/imu/icm42688p.h"
#include "tests/drivers/sensors/imu/adis_model.h"
#include "tests/drivers/sensors/imu/bmi_model.h"
#include "tests/drivers/sensors/imu/icm_model.h"
#include "tests/drivers/sensors/imu/spi_rig.h"

namespace epiline::test {

/// One bit of a register that the driver sets, by the data sheet. `bank`: of the BMI088 0 accelerometer, 1 gyroscope.
struct RegisterBit {
  int bank, address, bit;
};

struct AdisRig : ChipRig<AdisModel> {
  explicit AdisRig(const ImuDeviceConfig& settings, bool has_line = true, const WorldSettings& world_settings = {})
      : ChipRig(settings, world_settings) {
    world->now_ns += 1'000'000'000;  // the chip has been on for a while
    model.run(world->now_ns);
    model.edges.clear();
    model.truths.clear();
    auto wires = std::make_unique<AdisBus>(model);
    bus = wires.get();
    make_imu(std::make_unique<Adis16470>(config, std::move(wires), *world), has_line);
  }
  AdisBus* bus = nullptr;

  static constexpr double kRate = 200, kWorstAccel = 1e-3, kBitErrorRate = 1e-3;
  static constexpr bool kHasFifo = false;
  static constexpr std::int64_t kPolledWithin_ns = 400'000;
  static constexpr int kSlowestWakeUp_us = 60;
  static inline const std::vector<std::int64_t> kStalls_ms;
  static inline const std::vector<double> kRates{50, 100, 200, 333, 500, 1000}, kGyroscopeRanges{2000},
      kAccelerometerRanges{100, 392};
  static inline const std::vector<RegisterBit> kRegisters{{0, 0x5C, 0x01}, {0, 0x60, 0x40}, {0, 0x64, 0x01}};
  std::vector<ModelBus*> buses() { return {bus}; }
  auto& reg(const RegisterBit& r) { return model.reg(static_cast<std::uint8_t>(r.address)); }
  void set_clock_error(double error) { model.clock_error = error; }
  /// The supply fails: wholly, or so that the chip only tells of less than 2.8 V.
  void brown_out(bool whole) { whole ? model.power_on() : void(model.next_status = 1U << 4); }
  void expect_nothing_odd() const {
    EXPECT_NEAR(imu->counts().temperature_c, 31.4, 1e-6);
    EXPECT_EQ(imu->counts().lost, 0U);
    EXPECT_EQ(model.too_soon, 0);
  }
};

struct BmiRig : ChipRig<BmiModel> {
  explicit BmiRig(const ImuDeviceConfig& settings, bool has_line = true, const WorldSettings& world_settings = {},
                  bool is_swapped = false)
      : ChipRig(settings, world_settings) {
    std::unique_ptr<ModelBus> gyro = std::make_unique<BmiGyroBus>(model), accel = std::make_unique<BmiAccelBus>(model);
    gyro_bus = gyro.get();
    accel_bus = accel.get();
    if (is_swapped) gyro.swap(accel);
    auto chip = std::make_unique<Bmi088>(config, std::move(gyro), std::move(accel), *world);
    model.gyro_delay_ns = chip->facts().gyroscope_delay.ns;
    model.accel_delay_ns = chip->facts().accelerometer_delay.ns;
    make_imu(std::move(chip), has_line);
  }
  ModelBus *gyro_bus = nullptr, *accel_bus = nullptr;

  // half a count of 24 g is 3.6 mm/s^2; 16 m/s^3 times what the time of the accelerometer may be off, 0.1 ms
  static constexpr double kRate = 400, kWorstAccel = 0.0052, kBitErrorRate = 1e-4;
  static constexpr bool kHasFifo = true;
  static constexpr std::int64_t kPolledWithin_ns = 250'000;
  static constexpr int kSlowestWakeUp_us = 100;
  static inline const std::vector<std::int64_t> kStalls_ms{150, 200, 400};  ///< 146 frames of 1.25 ms fit
  static inline const std::vector<double> kRates{100, 200, 400, 1000, 2000}, kGyroscopeRanges{100, 250, 900, 2000},
      kAccelerometerRanges{29, 50, 110, 235};
  static inline const std::vector<RegisterBit> kRegisters{
      {0, 0x7C, 0x01}, {0, 0x40, 0x10}, {0, 0x41, 0x01}, {0, 0x48, 0x01}, {0, 0x49, 0x08}, {1, 0x0F, 0x01},
      {1, 0x11, 0x20}, {1, 0x16, 0x02}, {1, 0x18, 0x04}, {1, 0x15, 0x40}, {1, 0x1E, 0x80}};
  std::vector<ModelBus*> buses() { return {gyro_bus, accel_bus}; }
  auto& reg(const RegisterBit& r) {
    const auto address = static_cast<std::uint8_t>(r.address);
    return r.bank == 1 ? model.gyro_reg(address) : model.accel_reg(address);
  }
  void set_clock_error(double error) {
    model.clock_error = error;
    model.accel_clock_error = -0.7 * error;
  }
  /// The supply of both halves fails, or of the accelerometer alone.
  void brown_out(bool whole) { whole ? model.power_on() : model.lose_accel(); }
  void expect_nothing_odd() const { EXPECT_LE(imu->counts().unmerged, 2U) << "before the first of the accelerometer"; }
};

struct IcmRig : ChipRig<IcmModel> {
  explicit IcmRig(const ImuDeviceConfig& settings, bool has_line = true, const WorldSettings& world_settings = {})
      : ChipRig(settings, world_settings) {
    auto wires = std::make_unique<IcmBus>(model);
    bus = wires.get();
    make_imu(std::make_unique<Icm42688p>(config, std::move(wires), *world), has_line);
  }
  IcmBus* bus = nullptr;

  static constexpr double kRate = 500, kWorstAccel = 1e-3, kBitErrorRate = 1e-4;
  static constexpr bool kHasFifo = true;
  static constexpr std::int64_t kPolledWithin_ns = 200'000;
  static constexpr int kSlowestWakeUp_us = 150;
  static inline const std::vector<std::int64_t> kStalls_ms{400};
  static inline const std::vector<double> kRates{50, 100, 200, 333, 500, 1000, 2000},
      kGyroscopeRanges{15, 100, 250, 900, 2000}, kAccelerometerRanges{19, 30, 78, 157};
  static inline const std::vector<RegisterBit> kRegisters{
      {1, 0x0B, 0x01}, {1, 0x0C, 0x01}, {1, 0x0D, 0x01}, {1, 0x0E, 0x01}, {2, 0x03, 0x02}, {2, 0x04, 0x01},
      {2, 0x05, 0x01}, {0, 0x14, 0x02}, {0, 0x4C, 0x40}, {0, 0x4D, 0x01}, {0, 0x4F, 0x20}, {0, 0x50, 0x20},
      {0, 0x51, 0x02}, {0, 0x52, 0x01}, {0, 0x53, 0x04}, {0, 0x54, 0x08}, {0, 0x60, 0x01}, {0, 0x61, 0x01},
      {0, 0x5F, 0x01}, {0, 0x63, 0x01}, {0, 0x64, 0x10}, {0, 0x65, 0x01}, {0, 0x16, 0x40}};
  std::vector<ModelBus*> buses() { return {bus}; }
  auto& reg(const RegisterBit& r) { return model.reg(r.bank, static_cast<std::uint8_t>(r.address)); }
  void set_clock_error(double error) { model.clock_error = error; }
  void brown_out(bool /*whole*/) { model.power_on(); }
  void expect_nothing_odd() const {
    EXPECT_NEAR(imu->counts().temperature_c, 31, 0.3);
    EXPECT_EQ(imu->counts().clock.by_model, 0U);
  }
};

}  // namespace epiline::test
