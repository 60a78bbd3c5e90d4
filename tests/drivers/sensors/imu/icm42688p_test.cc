#include "drivers/sensors/imu/icm42688p.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/drivers/sensors/imu/chip_rigs.h"

namespace epiline {
namespace {

using namespace epiline::test;

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

TEST(Icm42688p, LengthOfItsCountsIsMeasured) {
  struct Case {
    double hz;
    bool has_line;
    double clock_error, pll_scale, rate;
  };
  for (const Case& c : {Case{25, true, 0.004, 1, 1.004},
                        {1000, true, 0.004, 1, 1.004},
                        {1000, true, 0, 32.0 / 30, 0.9375},
                        {1000, false, 0, 32.0 / 30, 0.9375}}) {
    IcmRig rig(at_rate(c.hz), c.has_line);
    rig.model.clock_error = c.clock_error;
    rig.model.pll_scale *= c.pll_scale;
    ASSERT_EQ(text(rig.imu->open()), "well");
    rig.read_for(20);
    EXPECT_NEAR(rig.imu->counts().clock_rate, c.rate, 0.002) << c.hz << c.has_line;
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

TEST(Icm42688p, PausesBetweenAttemptsToReopenGrow) {
  IcmRig rig(at_rate(1000));
  ASSERT_EQ(text(rig.imu->open()), "well");
  rig.read_for(0.5);
  const auto lose = [&](double seconds) {
    const std::uint64_t before = rig.imu->counts().retries;
    rig.bus->open_error = ENODEV;
    rig.bus->fail_next = 1;
    rig.read_for(seconds);
    EXPECT_FALSE(rig.imu->is_running());
    EXPECT_EQ(rig.imu->counts().last_error, ENODEV);
    return rig.imu->counts().retries - before;
  };
  const auto come_back = [&] {
    rig.bus->open_error = 0;
    rig.read_for(2);
    EXPECT_TRUE(rig.imu->is_running());
  };
  const std::uint64_t retries = lose(3);
  EXPECT_GE(retries, 4U);
  EXPECT_LE(retries, 12U);
  come_back();
  EXPECT_GE(lose(0.5), 3U) << "those of a new loss begin short";
  come_back();
  const Comparison result = rig.compared();
  EXPECT_EQ(result.unknown, 0U);
  EXPECT_LT(result.worst_late_ns + result.worst_early_ns, 20'000);
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

}  // namespace
}  // namespace epiline
