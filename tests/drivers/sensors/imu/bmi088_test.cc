#include "drivers/sensors/imu/bmi088.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/drivers/sensors/imu/bmi_model.h"
#include "tests/drivers/sensors/imu/spi_rig.h"

namespace epiline {
namespace {

using namespace epiline::test;

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
};

TEST(Bmi088, MergesTwoClocks) {
  WorldSettings exact;
  exact.edge_jitter_us = 0;
  BmiRig rig(at_rate(400), true, exact);
  rig.model.clock_error = 0.009;
  rig.model.accel_clock_error = -0.006;
  ASSERT_EQ(text(rig.imu->open()), "well");
  rig.read_for(10);
  const Comparison result = rig.compared();
  EXPECT_GT(result.samples, 3950U);
  EXPECT_EQ(result.unknown, 0U);
  EXPECT_EQ(result.missing, 0U);
  EXPECT_EQ(result.worst_early_ns, 0);
  EXPECT_EQ(result.worst_late_ns, 0);
  // half a count of 24 g is 3.6 mm/s^2; 16 m/s^3 times what the time of the accelerometer may be off, 0.1 ms
  EXPECT_LT(result.worst_accel_m_s2, 0.0052);
  EXPECT_LE(rig.imu->counts().unmerged, 2U);  // before the first of the accelerometer
}

TEST(Bmi088, RangesRatesAndEdgesAreAnyOfTheChips) {
  rc::check("values and stamps", [] {
    ImuDeviceConfig config;
    config.rate_hz = *rc::gen::element(100.0, 200.0, 400.0, 1000.0, 2000.0);
    config.gyroscope_range_deg_s = *rc::gen::element(100.0, 250.0, 900.0, 2000.0);
    config.accelerometer_range_m_s2 = *rc::gen::element(29.0, 50.0, 110.0, 235.0);
    config.ready_edge = *rc::gen::element(0, 1);
    WorldSettings settings;
    settings.seed = *rc::gen::arbitrary<unsigned>();
    settings.edge_jitter_us = *rc::gen::inRange(0, 30);
    settings.wake_up_us = *rc::gen::inRange(5, 100);
    settings.stall_share = *rc::gen::element(0.0, 0.02, 0.2);
    settings.stall_most_ms = *rc::gen::inRange(0, 15);
    BmiRig rig(config, true, settings);
    rig.model.clock_error = *rc::gen::inRange(-15, 16) * 1e-3;
    rig.model.accel_clock_error = *rc::gen::inRange(-15, 16) * 1e-3;
    RC_ASSERT(text(rig.imu->open()) == "well");
    rig.read_for(2);
    const Comparison result = rig.compared();
    RC_ASSERT(result.unknown + result.missing == 0U);
    RC_ASSERT(result.samples > 0.9 * 2 * rig.imu->facts().rate_hz);
    RC_ASSERT(result.worst_early_ns <= 40'000);
    RC_ASSERT(result.worst_late_ns <= 70'000);
    RC_ASSERT(result.worst_accel_m_s2 < 0.0052);
    RC_ASSERT(rig.reading.failed == 0U);
  });
}

TEST(Bmi088, WithoutALineItIsPolled) {
  BmiRig rig(at_rate(400), false);
  rig.model.clock_error = 0.007;
  rig.model.accel_clock_error = 0.0052;
  ASSERT_EQ(text(rig.imu->open()), "well");
  rig.read_for(10);
  const Comparison result = rig.compared();
  EXPECT_EQ(result.unknown + result.missing, 0U);
  EXPECT_GT(result.samples, 3900U);
  EXPECT_LT(result.worst_early_ns, 250'000);
  EXPECT_LT(result.worst_late_ns, 250'000);
  EXPECT_LT(result.worst_accel_m_s2, 0.0052);
}

TEST(Bmi088, DelayFollowsFromTheBandwidth) {
  BmiRig rig(at_rate(400));
  EXPECT_NEAR(rig.imu->facts().gyroscope_delay.seconds(), std::sqrt(2.0) / (2 * std::numbers::pi * 47), 1e-6);
  EXPECT_NEAR(rig.imu->facts().accelerometer_delay.seconds(), std::sqrt(2.0) / (2 * std::numbers::pi * 75), 1e-6);
}

TEST(Bmi088, SaysWhoIsThereInstead) {
  BmiRig swapped(at_rate(400), true, {}, true);
  std::string told = text(swapped.imu->open());
  EXPECT_NE(told.find("imu.device and imu.device_accel swapped"), std::string::npos) << told;
  BmiRig open_line(at_rate(400));
  open_line.accel_bus->stuck = 0xff;
  told = text(open_line.imu->open());
  EXPECT_NE(told.find("wrong identity 0xff [identity register of the accelerometer]; expected 0x1e"), std::string::npos)
      << told;
  BmiRig dead(at_rate(400));
  dead.gyro_bus->stuck = 0;
  told = text(dead.imu->open());
  EXPECT_NE(told.find("wrong identity 0x00 [identity register of the gyroscope]"), std::string::npos) << told;
}

TEST(Bmi088, ABrownOutOfEitherHalfIsFoundAndMended) {
  for (const bool both : {true, false}) {
    BmiRig rig(at_rate(400));
    ASSERT_EQ(text(rig.imu->open()), "well");
    rig.read_for(1);
    for (int i = 0; i < 4; ++i) {
      both ? rig.model.power_on() : rig.model.lose_accel();
      rig.read_for(1);
    }
    const Comparison result = rig.compared();
    EXPECT_EQ(result.unknown, 0U);
    EXPECT_EQ(rig.imu->counts().resets, 4U);
    EXPECT_GT(result.samples, 1400U) << both;
    EXPECT_LT(result.worst_accel_m_s2, 0.0052);
    EXPECT_LT(result.worst_late_ns + result.worst_early_ns, 20'000);
  }
}

// Registers that it set, all but three; one bit of each, by the data sheet.
TEST(Bmi088, WhicheverRegisterChangesIsFoundAndSetAgain) {
  struct Bit {
    bool is_gyro;
    int address, bit;
  };
  for (const Bit& b : {Bit{false, 0x7C, 0x01},
                       {false, 0x40, 0x10},
                       {false, 0x41, 0x01},
                       {false, 0x48, 0x01},
                       {false, 0x49, 0x08},
                       {true, 0x0F, 0x01},
                       {true, 0x11, 0x20},
                       {true, 0x16, 0x02},
                       {true, 0x18, 0x04},
                       {true, 0x15, 0x40},
                       {true, 0x1E, 0x80}}) {
    SCOPED_TRACE(testing::Message() << (b.is_gyro ? "gyroscope" : "accelerometer") << ", register " << b.address);
    BmiRig rig(at_rate(400));
    ASSERT_EQ(text(rig.imu->open()), "well");
    rig.read_for(0.3);
    const auto address = static_cast<std::uint8_t>(b.address);
    auto& changed = (b.is_gyro ? rig.model.gyro_reg(address) : rig.model.accel_reg(address));
    const auto before = changed;
    changed ^= static_cast<std::uint8_t>(b.bit);
    rig.read_for(4);
    EXPECT_EQ(rig.imu->counts().resets + rig.imu->counts().disconnected, 1U) << "it may be silence that tells";
    EXPECT_EQ(changed, before);
  }
}

TEST(Bmi088, FifosThatRanOverAreEmptied) {
  BmiRig rig(at_rate(400));
  ASSERT_EQ(text(rig.imu->open()), "well");
  for (const std::int64_t stall_ms : {150, 200, 400}) {  // the accelerometer's holds 146 frames of 1.25 ms
    rig.read_for(1);
    rig.world->now_ns += stall_ms * 1'000'000;
    rig.model.run(rig.world->now_ns);
  }
  ASSERT_GT(rig.model.gyro_overflows, 0U);
  ASSERT_GT(rig.model.accel_overflows, 0U);
  rig.read_for(1);
  const Comparison result = rig.compared();
  EXPECT_EQ(result.unknown, 0U);
  EXPECT_EQ(rig.imu->counts().overflows, 1U);
  EXPECT_LT(result.worst_late_ns + result.worst_early_ns, 20'000);
  EXPECT_LT(result.worst_accel_m_s2, 0.0052);
  EXPECT_GT(result.samples, 1500U);
}

TEST(Bmi088, ABusThatFailsIsReopened) {
  BmiRig rig(at_rate(400));
  ASSERT_EQ(text(rig.imu->open()), "well");
  rig.read_for(0.5);
  rig.accel_bus->fail_next = 1;
  rig.read_for(1);
  rig.gyro_bus->fail_next = 1;
  rig.read_for(1);
  EXPECT_EQ(rig.imu->counts().disconnected, 2U);
  EXPECT_TRUE(rig.imu->is_running());
  EXPECT_EQ(rig.compared().unknown, 0U);
}

TEST(Bmi088, LinesThatGetStuckAreALoss) {
  for (const int level : {0x00, 0xff}) {
    for (const bool is_gyro : {true, false}) {
      BmiRig rig(at_rate(400));
      ASSERT_EQ(text(rig.imu->open()), "well");
      rig.read_for(0.3);
      ModelBus* const bus = is_gyro ? rig.gyro_bus : rig.accel_bus;
      bus->stuck = level;
      rig.read_for(2);
      EXPECT_FALSE(rig.imu->is_running()) << level << is_gyro;
      bus->stuck = -1;
      rig.read_for(2);
      EXPECT_TRUE(rig.imu->is_running()) << level << is_gyro;
      EXPECT_EQ(rig.compared().unknown, 0U) << level << is_gyro;
    }
  }
}

TEST(Bmi088, BitErrorsNeitherHangNorShiftTheTime) {
  WorldSettings settings;
  settings.edge_jitter_us = 0;
  BmiRig rig(at_rate(400), true, settings);
  ASSERT_EQ(text(rig.imu->open()), "well");
  rig.gyro_bus->bit_error_rate = rig.accel_bus->bit_error_rate = 1e-4;
  rig.read_for(20);
  rig.gyro_bus->bit_error_rate = rig.accel_bus->bit_error_rate = 0;
  rig.read_for(1);
  rig.reading.samples.clear();
  rig.read_for(2);
  const Comparison result = rig.compared();
  EXPECT_GT(result.samples, 750U);
  EXPECT_EQ(result.unknown, 0U);
  EXPECT_EQ(result.worst_late_ns + result.worst_early_ns, 0);
  EXPECT_LT(result.worst_accel_m_s2, 0.0052);
}

TEST(Bmi088, ReadingNeedsNoHeap) {
  if (!allocation_counting_available()) GTEST_SKIP() << "heap calls are not counted in this build";
  BmiRig rig(at_rate(400));
  ASSERT_EQ(text(rig.imu->open()), "well");
  rig.model.heap_calls = 0;
  rig.read_for(0.5);
  rig.model.power_on();
  rig.read_for(0.5);
  rig.gyro_bus->fail_next = 1;
  rig.read_for(0.5);
  EXPECT_GT(rig.reading.samples.size(), 400U);
  EXPECT_EQ(rig.reading.heap_calls, rig.model.heap_calls);
}

// Frames by hand, from section 4.9.
TEST(BmiFrames, AreReadUpToTheTime) {
  const std::vector<std::uint8_t> bytes{0x84, 1, 0,    0xff, 0xff, 0,    0x80, 0x48, 0x01, 0x87, 2, 1, 4, 3,
                                        6,    5, 0x44, 0x10, 0x20, 0x30, 0x84, 9,    9,    9,    9, 9, 9};
  BmiAccelFrames frames;
  ASSERT_TRUE(parse_bmi_accel(bytes, frames));
  ASSERT_EQ(frames.values.size(), 2U);
  EXPECT_EQ(frames.values[0], (BmiVector{1, -1, -32768}));
  EXPECT_EQ(frames.values[1], (BmiVector{0x0102, 0x0304, 0x0506}));
  EXPECT_TRUE(frames.has_time);
  EXPECT_EQ(frames.time, 0x302010U);
}

TEST(BmiFrames, WhatCameBeforeAGapIsNotInARow) {
  const std::vector<std::uint8_t> bytes{0x84, 1, 0, 1, 0, 1, 0, 0x40, 7, 0x84, 2, 0, 2, 0, 2, 0, 0x84, 3};
  BmiAccelFrames frames;
  ASSERT_TRUE(parse_bmi_accel(bytes, frames));
  ASSERT_EQ(frames.values.size(), 1U);
  EXPECT_EQ(frames.skipped, 7U);
  EXPECT_FALSE(frames.has_time);
}

TEST(BmiFrames, AnotherHeaderIsDamage) {
  BmiAccelFrames frames;
  EXPECT_FALSE(parse_bmi_accel(std::vector<std::uint8_t>{0x12, 0, 0, 0}, frames));
  EXPECT_TRUE(parse_bmi_accel(std::vector<std::uint8_t>{0x80, 0, 0, 0}, frames));
}

}  // namespace
}  // namespace epiline
