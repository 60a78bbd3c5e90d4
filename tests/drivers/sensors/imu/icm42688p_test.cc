#include "drivers/sensors/imu/icm42688p.h"

#include <gtest/gtest.h>

#include "tests/drivers/sensors/imu/chip_rigs.h"

namespace epiline {
namespace {

using namespace epiline::test;

TEST(Icm42688p, LostEdgesCostOnlyTheirOwnExactness) {
  IcmRig rig(at_rate(1000), true,
             {.stall_share = 0.05, .stall_most_ms = 6, .edge_jitter_us = 2, .edge_lost_share = 0.2});
  rig.model.clock_error = 0.005;
  rig.open(5);
  const Comparison result = rig.compared();
  EXPECT_EQ(result.unknown + result.missing, 0U);
  EXPECT_LT(result.worst_ns(), 20'000);
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
    rig.open(20);
    EXPECT_NEAR(rig.imu->counts().clock_rate, c.rate, 0.002) << c.hz << c.has_line;
    EXPECT_GT(rig.imu->facts().clock_tolerance, 0);
  }
}

TEST(Icm42688p, TheGyroscopeDoesNotStickAt100DegPerSecond) {
  // Betaflight and PX4: bits 7:6 of 0x4D are 10 after a reset, and 01 switch AFSR off
  IcmRig rig(at_rate(1000));
  EXPECT_EQ(rig.model.reg(0, 0x4D) & 0xC0, 0x80);
  rig.open();
  EXPECT_EQ(rig.model.reg(0, 0x4D) & 0xC0, 0x40);
  EXPECT_EQ(rig.model.reg(0, 0x4D) & 0x07, 0x01);  // the PLL is still selected
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

TEST(Icm42688p, PausesBetweenAttemptsToReopenGrow) {
  IcmRig rig(at_rate(1000));
  rig.open(0.5);
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
  rig.open(2);
  rig.line->is_cut = true;
  rig.read_for(20);
  const Comparison result = rig.compared();
  EXPECT_EQ(result.unknown + result.missing, 0U);
  EXPECT_GT(result.samples, 21'500U);
  EXPECT_LT(result.worst_ns(), 500'000);
}

TEST(Icm42688p, AGarbledTimeStampShiftsNothing) {
  IcmRig rig(at_rate(1000), true, {.edge_jitter_us = 0});
  rig.open();
  for (int i = 0; i < 20; ++i) {
    rig.read_for(0.1);
    rig.model.garbles_next_time = true;
  }
  const Comparison result = rig.compared();
  EXPECT_EQ(result.unknown + result.missing, 0U);
  EXPECT_EQ(result.worst_ns(), 0);
  EXPECT_EQ(rig.imu->counts().clock.realigned, 0U);
  EXPECT_EQ(rig.imu->counts().clock.by_model, 0U);
}

// Bytes put together by hand from the tables of section 6.1.
TEST(IcmPacket, ShortOnesHaveSixteenBitsAValue) {
  const std::vector<std::uint8_t> bytes{0x68, 0x00, 0x01, 0xff, 0xff, 0x08, 0x00, 0x7f,
                                        0xff, 0x80, 0x02, 0x12, 0x34, 0xf6, 0xab, 0xcd};
  IcmPacket packet;
  ASSERT_EQ(parse_icm_packet(bytes, IcmPacketKind::kShort, packet), IcmParse::kData);
  EXPECT_EQ(packet.accel, (std::array<std::int32_t, 3>{1, -1, 2048}));
  EXPECT_EQ(packet.gyro, (std::array<std::int32_t, 3>{32767, -32766, 0x1234}));
  EXPECT_TRUE(packet.is_valid);
  EXPECT_EQ(packet.timestamp, 0xabcd);
  EXPECT_NEAR(packet.temperature_c, -10 / 2.07 + 25, 1e-12);
}

TEST(IcmPacket, LongOnesHaveTwentyBitsAValue) {
  const std::vector<std::uint8_t> bytes{0x78, 0x7f, 0xff, 0x80, 0x02, 0xff, 0xff, 0x00, 0x10, 0xff,
                                        0xf0, 0x80, 0x02, 0x03, 0x1b, 0x00, 0x2a, 0xc2, 0x0e, 0x4c};
  IcmPacket packet;
  ASSERT_EQ(parse_icm_packet(bytes, IcmPacketKind::kLong, packet), IcmParse::kData);
  EXPECT_EQ(packet.accel, (std::array<std::int32_t, 3>{524284, -524256, -12}));
  EXPECT_EQ(packet.gyro, (std::array<std::int32_t, 3>{258, -242, -524244}));
  EXPECT_EQ(packet.timestamp, 42);
  EXPECT_NEAR(packet.temperature_c, 31, 0.005);
}

TEST(IcmPacket, AValueThatSaysInvalidMakesThePacketSo) {
  std::vector<std::uint8_t> bytes(16, 0);
  bytes[0] = 0x6b;  // the rate has changed: no matter
  bytes[9] = 0x80;
  IcmPacket packet;
  ASSERT_EQ(parse_icm_packet(bytes, IcmPacketKind::kShort, packet), IcmParse::kData);
  EXPECT_FALSE(packet.is_valid);
}

TEST(IcmPacket, EveryOtherHeaderIsTheEndOrDamage) {
  for (int header = 0; header < 256; ++header) {
    std::vector<std::uint8_t> bytes(20, 0);
    bytes[0] = static_cast<std::uint8_t>(header);
    IcmPacket packet;
    const IcmParse outcome = parse_icm_packet(bytes, IcmPacketKind::kLong, packet);
    const IcmParse wanted = header >= 0x78 && header <= 0x7b   ? IcmParse::kData
                            : header == 0x80 || header == 0xff ? IcmParse::kEmpty
                                                               : IcmParse::kDamaged;
    EXPECT_EQ(outcome, wanted) << header;
  }
}

}  // namespace
}  // namespace epiline
