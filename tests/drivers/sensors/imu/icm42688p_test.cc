#include "drivers/sensors/imu/icm42688p.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/drivers/sensors/imu/icm_model.h"
#include "tests/drivers/sensors/imu/spi_rig.h"

namespace epiline {
namespace {

using namespace epiline::test;

struct IcmRig : ChipRig<IcmModel> {
  explicit IcmRig(const ImuDeviceConfig& settings, bool has_line = true, const WorldSettings& world_settings = {})
      : ChipRig(settings, world_settings) {
    auto wires = std::make_unique<IcmBus>(model);
    bus = wires.get();
    make_imu(std::make_unique<Icm42688p>(config, std::move(wires), *world), has_line);
  }
  IcmBus* bus = nullptr;
};

TEST(Icm42688p, GivesEverySampleOnceWithTheTimeOfItsEdge) {
  WorldSettings exact;
  exact.edge_jitter_us = 0;
  IcmRig rig(at_rate(1000), true, exact);
  rig.model.clock_error = 0.008;
  ASSERT_EQ(text(rig.imu->open()), "well");
  rig.read_for(5);
  const Comparison result = rig.compared();
  EXPECT_GE(result.samples, 4950U);
  EXPECT_EQ(result.unknown, 0U);
  EXPECT_EQ(result.missing, 0U);
  EXPECT_EQ(result.worst_early_ns, 0);
  EXPECT_EQ(result.worst_late_ns, 0);
  EXPECT_LT(result.worst_accel_m_s2, 1e-3);
  EXPECT_EQ(rig.imu->counts().clock.by_model, 0U);
  EXPECT_NEAR(rig.imu->counts().temperature_c, 31, 0.3);
}

TEST(Icm42688p, ALateReaderShiftsNoStamp) {
  WorldSettings late;
  late.edge_jitter_us = 0;
  late.stall_share = 0.2;
  late.stall_most_ms = 12;
  IcmRig rig(at_rate(1000), true, late);
  rig.model.clock_error = -0.01;
  ASSERT_EQ(text(rig.imu->open()), "well");
  rig.read_for(5);
  const Comparison result = rig.compared();
  EXPECT_EQ(result.unknown + result.missing, 0U);
  EXPECT_EQ(result.worst_early_ns, 0);
  EXPECT_EQ(result.worst_late_ns, 0);
  EXPECT_GT(result.samples, 4900U);
}

TEST(Icm42688p, LostEdgesCostOnlyTheirOwnExactness) {
  WorldSettings lossy;
  lossy.edge_jitter_us = 2;
  lossy.edge_lost_share = 0.2;
  lossy.stall_share = 0.05;
  lossy.stall_most_ms = 6;
  IcmRig rig(at_rate(1000), true, lossy);
  rig.model.clock_error = 0.005;
  ASSERT_EQ(text(rig.imu->open()), "well");
  rig.read_for(5);
  const Comparison result = rig.compared();
  EXPECT_EQ(result.unknown + result.missing, 0U);
  EXPECT_LT(result.worst_early_ns, 20'000);
  EXPECT_LT(result.worst_late_ns, 20'000);
  const SampleClockCounts clock = rig.imu->counts().clock;
  EXPECT_NEAR(static_cast<double>(clock.by_model) / static_cast<double>(clock.by_model + clock.by_edge), 0.2, 0.03);
}

TEST(Icm42688p, WithoutALineItIsPolledByItsOwnTime) {
  IcmRig rig(at_rate(500), false);
  rig.model.clock_error = 0.007;
  ASSERT_EQ(text(rig.imu->open()), "well");
  rig.read_for(10);
  const Comparison result = rig.compared();
  EXPECT_EQ(result.unknown + result.missing, 0U);
  EXPECT_GT(result.samples, 4900U);
  EXPECT_LT(result.worst_early_ns, 200'000);
  EXPECT_LT(result.worst_late_ns, 200'000);
  EXPECT_NEAR(rig.imu->clock_state().skew_ppm, -7000, 150);
}

TEST(Icm42688p, ItsCountsLastAsLongAsTheVendorSays) {
  for (const double hz : {25.0, 1000.0}) {
    IcmRig rig(at_rate(hz));
    rig.model.clock_error = 0.004;
    ASSERT_EQ(text(rig.imu->open()), "well");
    rig.read_for(20);
    EXPECT_NEAR(rig.imu->counts().clock_rate, 1.004, 0.002) << hz;
  }
}

TEST(Icm42688p, AnotherLengthOfItsCountsIsMeasured) {
  for (const bool has_line : {true, false}) {
    IcmRig rig(at_rate(1000), has_line);
    rig.model.pll_scale = (32.0 / 30) * (32.0 / 30);
    ASSERT_EQ(text(rig.imu->open()), "well");
    rig.read_for(20);
    EXPECT_NEAR(rig.imu->counts().clock_rate, 0.9375, 0.002) << has_line;
    EXPECT_GT(rig.imu->facts().clock_tolerance, 0);
  }
}

TEST(Icm42688p, TheGyroscopeDoesNotStickAt100DegPerSecond) {
  // Betaflight and PX4: bits 7:6 of 0x4D are 10 after a reset, and 01 switch AFSR off
  IcmRig rig(at_rate(1000));
  EXPECT_EQ(rig.model.reg(0, 0x4D) & 0xC0, 0x80);
  ASSERT_EQ(text(rig.imu->open()), "well");
  EXPECT_EQ(rig.model.reg(0, 0x4D) & 0xC0, 0x40);
  EXPECT_EQ(rig.model.reg(0, 0x4D) & 0x07, 0x01);  // the PLL is still selected
}

TEST(Icm42688p, RangesRatesAndEdgesAreAnyOfTheChips) {
  rc::check("values and stamps", [] {
    ImuDeviceConfig config;
    config.rate_hz = *rc::gen::element(50.0, 100.0, 200.0, 333.0, 500.0, 1000.0, 2000.0);
    config.gyroscope_range_deg_s = *rc::gen::element(15.0, 100.0, 250.0, 900.0, 2000.0);
    config.accelerometer_range_m_s2 = *rc::gen::element(19.0, 30.0, 78.0, 157.0);
    config.ready_edge = *rc::gen::element(0, 1);
    config.delay_ms = *rc::gen::element(0.0, 1.25);
    WorldSettings settings;
    settings.seed = *rc::gen::arbitrary<unsigned>();
    settings.edge_jitter_us = *rc::gen::inRange(0, 30);
    settings.edge_visible_us = *rc::gen::element(0, 0, 60);
    settings.wake_up_us = *rc::gen::inRange(5, 150);
    settings.stall_share = *rc::gen::element(0.0, 0.02, 0.3);
    settings.stall_most_ms = *rc::gen::inRange(0, 20);
    IcmRig rig(config, true, settings);
    rig.model.clock_error = *rc::gen::inRange(-15, 16) * 1e-3;
    RC_ASSERT(text(rig.imu->open()) == "well");
    rig.read_for(2);
    const Comparison result = compare(rig.reading.samples, rig.model.truths,
                                      rig.imu->facts().gyroscope_delay + Span::from_seconds(config.delay_ms * 1e-3));
    RC_ASSERT(result.unknown + result.missing == 0U);
    RC_ASSERT(result.samples > 0.9 * 2 * rig.imu->facts().rate_hz);
    RC_ASSERT(result.worst_early_ns <= 40'000);
    RC_ASSERT(result.worst_late_ns <= 70'000);
    RC_ASSERT(result.worst_accel_m_s2 < 1e-3);
    RC_ASSERT(rig.reading.failed == 0U);
  });
}

TEST(Icm42688p, DelayIsThatOfTheFiltersAsSet) {
  // DS-000347: 3.3 ms of the UI filter at 200 Hz; anti-alias filter of second order at 213 Hz
  IcmRig rig(at_rate(200));
  EXPECT_NEAR(rig.imu->facts().gyroscope_delay.seconds(), 3.3e-3 + std::sqrt(2.0) / (2 * std::numbers::pi * 213), 1e-6);
}

TEST(Icm42688p, SaysWhoIsThereInstead) {
  const auto told = [](auto&& fault) {
    IcmRig rig(at_rate(1000));
    fault(rig);
    return text(rig.imu->open());
  };
  EXPECT_NE(told([](IcmRig& rig) { rig.bus->stuck = 0x00; }).find("MISO not connected"), std::string::npos);
  EXPECT_NE(told([](IcmRig& rig) { rig.bus->stuck = 0xff; }).find("Wrong chip select"), std::string::npos);
  const std::string bmi = told([](IcmRig& rig) { rig.model.reg(0, 0x75) = 0x1e; });
  EXPECT_NE(bmi.find("0x1e, the accelerometer of a BMI088 [identity register]; expected 0x47"), std::string::npos)
      << bmi;
  EXPECT_NE(told([](IcmRig& rig) { rig.model.reg(0, 0x75) = 0x23; }).find("shifted by one"), std::string::npos);
  EXPECT_NE(told([](IcmRig& rig) { rig.bus->open_error = ENOENT; }).find("No such file"), std::string::npos);
}

TEST(Icm42688p, SaysThatNoEdgeComes) {
  IcmRig rig(at_rate(1000));
  rig.config.ready_line = "IMU_INT";
  rig.line->is_cut = true;
  const std::string told = text(rig.imu->open());
  EXPECT_NE(told.find("no data-ready edge"), std::string::npos) << told;
}

TEST(Icm42688p, SaysWhatItCannotDo) {
  ImuDeviceConfig config = at_rate(1000);
  config.accelerometer_range_m_s2 = 300;
  IcmRig rig(config);
  const std::string told = text(rig.imu->open());
  EXPECT_NE(told.find("at most 2000 deg/s, 157 m/s^2"), std::string::npos) << told;
  EXPECT_EQ(rig.bus->times_opened, 0);
}

TEST(Icm42688p, ABrownOutIsFoundAndMendedAndNothingWrongIsHandedOut) {
  IcmRig rig(at_rate(1000));
  ASSERT_EQ(text(rig.imu->open()), "well");
  rig.read_for(1);
  for (int i = 0; i < 5; ++i) {
    rig.model.power_on();
    rig.read_for(1);
  }
  const Comparison result = rig.compared();
  EXPECT_EQ(result.unknown, 0U);
  EXPECT_EQ(rig.imu->counts().resets, 5U);
  EXPECT_GT(result.samples, 5500U);  // each costs the start of the gyroscope
  EXPECT_LT(result.worst_late_ns + result.worst_early_ns, 20'000);
}

TEST(Icm42688p, ARegisterThatChangesIsFound) {
  IcmRig rig(at_rate(1000));
  ASSERT_EQ(text(rig.imu->open()), "well");
  rig.read_for(1);
  rig.model.reg(2, 0x04) ^= 0x08;  // of the anti-alias filter
  rig.read_for(3);
  EXPECT_EQ(rig.imu->counts().resets, 1U);
  EXPECT_GT(rig.imu->counts().checked, 20U);
  EXPECT_EQ(rig.compared().unknown, 0U);
}

// Each register that it set but power management and the bank; one bit of each, by the data sheet.
TEST(Icm42688p, WhicheverRegisterChangesIsFoundAndSetAgain) {
  struct Bit {
    int bank, address, bit;
  };
  for (const Bit& b :
       {Bit{1, 0x0B, 0x01}, {1, 0x0C, 0x01}, {1, 0x0D, 0x01}, {1, 0x0E, 0x01}, {2, 0x03, 0x02}, {2, 0x04, 0x01},
        {2, 0x05, 0x01},    {0, 0x14, 0x02}, {0, 0x4C, 0x40}, {0, 0x4D, 0x01}, {0, 0x4F, 0x20}, {0, 0x50, 0x20},
        {0, 0x51, 0x02},    {0, 0x52, 0x01}, {0, 0x53, 0x04}, {0, 0x54, 0x08}, {0, 0x60, 0x01}, {0, 0x61, 0x01},
        {0, 0x5F, 0x01},    {0, 0x63, 0x01}, {0, 0x64, 0x10}, {0, 0x65, 0x01}, {0, 0x16, 0x40}}) {
    SCOPED_TRACE(testing::Message() << "bank " << b.bank << ", register " << b.address);
    IcmRig rig(at_rate(200));
    ASSERT_EQ(text(rig.imu->open()), "well");
    rig.read_for(0.3);
    auto& changed = rig.model.reg(b.bank, static_cast<std::uint8_t>(b.address));
    const auto before = changed;
    changed ^= static_cast<std::uint8_t>(b.bit);
    rig.read_for(4);
    EXPECT_EQ(rig.imu->counts().resets + rig.imu->counts().disconnected, 1U) << "it may be silence that tells";
    EXPECT_EQ(changed, before);
  }
}

TEST(Icm42688p, AFifoThatRanOverIsEmptied) {
  IcmRig rig(at_rate(1000));
  ASSERT_EQ(text(rig.imu->open()), "well");
  rig.read_for(1);
  rig.world->now_ns += 300'000'000;
  rig.model.run(rig.world->now_ns);
  ASSERT_GT(rig.model.overflows, 0U);
  rig.read_for(1);
  const Comparison result = rig.compared();
  EXPECT_EQ(result.unknown, 0U);
  EXPECT_EQ(rig.imu->counts().overflows, 1U);
  EXPECT_GE(rig.imu->counts().lost, 100U);
  EXPECT_LT(result.worst_late_ns + result.worst_early_ns, 20'000);
  EXPECT_GT(result.samples, 1900U);
}

TEST(Icm42688p, ABusThatFailsIsReopened) {
  IcmRig rig(at_rate(1000));
  ASSERT_EQ(text(rig.imu->open()), "well");
  rig.read_for(0.5);
  rig.bus->fail_next = 1;
  rig.read_for(0.5);
  EXPECT_EQ(rig.imu->counts().disconnected, 1U);
  EXPECT_EQ(rig.imu->counts().last_error, EIO);
  EXPECT_TRUE(rig.imu->is_running());
  rig.bus->open_error = ENODEV;
  rig.bus->fail_next = 1;
  rig.read_for(3);
  EXPECT_FALSE(rig.imu->is_running());
  EXPECT_GE(rig.imu->counts().retries, 4U);
  EXPECT_LE(rig.imu->counts().retries, 12U);  // with longer and longer pauses
  EXPECT_EQ(rig.imu->counts().last_error, ENODEV);
  rig.bus->open_error = 0;
  rig.read_for(2);
  EXPECT_TRUE(rig.imu->is_running());
  // the pauses of a new loss begin short
  rig.bus->open_error = ENODEV;
  rig.bus->fail_next = 1;
  const std::uint64_t before = rig.imu->counts().retries;
  rig.read_for(0.5);
  EXPECT_GE(rig.imu->counts().retries, before + 3);
  rig.bus->open_error = 0;
  rig.read_for(2);
  EXPECT_TRUE(rig.imu->is_running());
  const Comparison result = rig.compared();
  EXPECT_EQ(result.unknown, 0U);
  EXPECT_LT(result.worst_late_ns + result.worst_early_ns, 20'000);
}

TEST(Icm42688p, LinesThatGetStuckAreALoss) {
  for (const int level : {0x00, 0xff}) {
    IcmRig rig(at_rate(1000));
    ASSERT_EQ(text(rig.imu->open()), "well");
    rig.read_for(0.3);
    rig.bus->stuck = level;
    rig.read_for(2);
    EXPECT_FALSE(rig.imu->is_running()) << level;
    EXPECT_GE(rig.imu->counts().disconnected, 1U);
    rig.bus->stuck = -1;
    rig.read_for(2);
    EXPECT_TRUE(rig.imu->is_running()) << level;
    EXPECT_EQ(rig.compared().unknown, 0U);
  }
}

TEST(Icm42688p, ALineThatBreaksCostsExactnessOnly) {
  IcmRig rig(at_rate(1000));
  rig.model.clock_error = 0.01;
  ASSERT_EQ(text(rig.imu->open()), "well");
  rig.read_for(2);
  rig.line->is_cut = true;
  rig.read_for(20);
  const Comparison result = rig.compared();
  EXPECT_EQ(result.unknown + result.missing, 0U);
  EXPECT_GT(result.samples, 21'500U);
  EXPECT_LT(result.worst_late_ns, 500'000);
  EXPECT_LT(result.worst_early_ns, 500'000);
}

TEST(Icm42688p, BitErrorsNeitherHangNorShiftTheTime) {
  WorldSettings settings;
  settings.edge_jitter_us = 0;
  IcmRig rig(at_rate(1000), true, settings);
  ASSERT_EQ(text(rig.imu->open()), "well");
  rig.bus->bit_error_rate = 1e-4;
  rig.read_for(20);
  rig.bus->bit_error_rate = 0;
  rig.reading.samples.clear();
  rig.read_for(2);
  const Comparison result = rig.compared();
  EXPECT_GT(result.samples, 1800U);
  EXPECT_EQ(result.unknown, 0U);
  EXPECT_EQ(result.worst_late_ns + result.worst_early_ns, 0);
  EXPECT_GT(rig.imu->counts().damaged + rig.imu->counts().resets, 0U);
}

TEST(Icm42688p, AGarbledTimeStampShiftsNothing) {
  WorldSettings settings;
  settings.edge_jitter_us = 0;
  IcmRig rig(at_rate(1000), true, settings);
  ASSERT_EQ(text(rig.imu->open()), "well");
  for (int i = 0; i < 20; ++i) {
    rig.read_for(0.1);
    rig.model.garbles_next_time = true;
  }
  const Comparison result = rig.compared();
  EXPECT_EQ(result.unknown + result.missing, 0U);
  EXPECT_EQ(result.worst_late_ns + result.worst_early_ns, 0);
  EXPECT_EQ(rig.imu->counts().clock.realigned, 0U);
  EXPECT_EQ(rig.imu->counts().clock.by_model, 0U);
}

TEST(Icm42688p, ReadingNeedsNoHeap) {
  if (!allocation_counting_available()) GTEST_SKIP() << "heap calls are not counted in this build";
  WorldSettings settings;
  settings.edge_lost_share = 0.1;
  IcmRig rig(at_rate(1000), true, settings);
  ASSERT_EQ(text(rig.imu->open()), "well");
  rig.model.heap_calls = 0;
  rig.read_for(0.5);
  rig.model.power_on();
  rig.read_for(0.5);
  rig.bus->fail_next = 1;
  rig.read_for(0.5);
  EXPECT_GT(rig.reading.samples.size(), 1000U);
  EXPECT_EQ(rig.imu->counts().resets + rig.imu->counts().disconnected, 2U);
  EXPECT_EQ(rig.reading.heap_calls, rig.model.heap_calls);
}

}  // namespace
}  // namespace epiline
