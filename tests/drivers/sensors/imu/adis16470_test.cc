#include "drivers/sensors/imu/adis16470.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include "tests/drivers/sensors/imu/adis_model.h"
#include "tests/drivers/sensors/imu/spi_rig.h"

namespace epiline {
namespace {

using namespace epiline::test;

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
};

TEST(Adis16470, GivesEverySampleOnceWithTheTimeOfItsEdge) {
  WorldSettings exact;
  exact.edge_jitter_us = 0;
  AdisRig rig(at_rate(200), true, exact);
  rig.model.clock_error = 0.004;
  ASSERT_EQ(text(rig.imu->open()), "well");
  rig.read_for(10);
  const Comparison result = rig.compared();
  EXPECT_GT(result.samples, 1980U);
  EXPECT_EQ(result.unknown + result.missing, 0U);
  EXPECT_EQ(result.worst_early_ns, 0);
  EXPECT_EQ(result.worst_late_ns, 0);
  EXPECT_LT(result.worst_accel_m_s2, 1e-3);
  EXPECT_NEAR(rig.imu->counts().temperature_c, 31.4, 1e-6);
  EXPECT_EQ(rig.imu->counts().lost, 0U);
  EXPECT_EQ(rig.model.too_soon, 0);
}

TEST(Adis16470, SamplesThatNobodyReadAreCountedAndShiftNothing) {
  WorldSettings late;
  late.edge_jitter_us = 0;
  late.stall_share = 0.1;
  late.stall_most_ms = 20;
  AdisRig rig(at_rate(400), true, late);
  rig.model.clock_error = -0.01;
  ASSERT_EQ(text(rig.imu->open()), "well");
  const std::uint64_t lost_before = rig.imu->counts().lost;
  rig.read_for(10);
  const Comparison result = rig.compared();
  EXPECT_EQ(result.unknown, 0U);
  EXPECT_GT(result.missing, 100U);
  EXPECT_NEAR(static_cast<double>(rig.imu->counts().lost - lost_before), static_cast<double>(result.missing), 10);
  EXPECT_LE(result.worst_early_ns, 20'000);
  EXPECT_LE(result.worst_late_ns, 20'000);
}

TEST(Adis16470, RatesAndEdgesAreAnyOfTheChips) {
  rc::check("values and stamps", [] {
    ImuDeviceConfig config;
    config.rate_hz = *rc::gen::element(50.0, 100.0, 200.0, 333.0, 500.0, 1000.0);
    config.ready_edge = *rc::gen::element(0, 1);
    config.accelerometer_range_m_s2 = *rc::gen::element(100.0, 392.0);
    WorldSettings settings;
    settings.seed = *rc::gen::arbitrary<unsigned>();
    settings.edge_jitter_us = *rc::gen::inRange(0, 30);
    settings.edge_lost_share = *rc::gen::element(0.0, 0.05);
    settings.wake_up_us = *rc::gen::inRange(5, 60);
    settings.stall_share = *rc::gen::element(0.0, 0.02);
    settings.stall_most_ms = *rc::gen::inRange(0, 15);
    AdisRig rig(config, true, settings);
    rig.model.clock_error = *rc::gen::inRange(-15, 16) * 1e-3;
    RC_ASSERT(text(rig.imu->open()) == "well");
    rig.read_for(2);
    const Comparison result = rig.compared();
    RC_ASSERT(result.unknown == 0U);
    RC_ASSERT(static_cast<double>(result.samples) > 0.6 * 2 * rig.imu->facts().rate_hz);
    RC_ASSERT(result.worst_early_ns <= 60'000);
    RC_ASSERT(result.worst_late_ns <= 70'000);
    RC_ASSERT(result.worst_accel_m_s2 < 1e-3);
    RC_ASSERT(rig.reading.failed == 0U);
    RC_ASSERT(rig.model.too_soon == 0);
  });
}

TEST(Adis16470, WithoutALineItIsPolledByItsCounter) {
  AdisRig rig(at_rate(200), false);
  rig.model.clock_error = 0.006;
  ASSERT_EQ(text(rig.imu->open()), "well");
  rig.read_for(10);
  const Comparison result = rig.compared();
  EXPECT_EQ(result.unknown, 0U);
  EXPECT_LT(result.missing, 20U);
  EXPECT_LT(result.worst_early_ns, 400'000);
  EXPECT_LT(result.worst_late_ns, 400'000);
}

TEST(Adis16470, DelayIsTheChipsAndTheDecimations) {
  AdisRig rig(at_rate(200));
  EXPECT_EQ(rig.imu->facts().gyroscope_delay.ns, 1'440'000 + 2'250'000);
  AdisRig fast(at_rate(2000));
  EXPECT_EQ(fast.imu->facts().gyroscope_delay.ns, 1'440'000);
}

TEST(Adis16470, BurstsStayBelowTheirOwnLimit) {
  ImuDeviceConfig config = at_rate(200);
  config.spi_hz = 2'000'000;
  AdisRig rig(config);
  ASSERT_EQ(text(rig.imu->open()), "well");
  rig.read_for(1);
  EXPECT_EQ(rig.imu->counts().damaged, 0U);
  EXPECT_GT(rig.compared().samples, 190U);
}

TEST(Adis16470, SaysWhoIsThereInstead) {
  AdisRig other(at_rate(200));
  other.model.reg(0x72) = 16475;
  std::string told = text(other.imu->open());
  EXPECT_NE(told.find("an ADIS16475 [identity register]; expected 0x4056"), std::string::npos) << told;
  AdisRig dead(at_rate(200));
  dead.bus->stuck = 0xff;
  told = text(dead.imu->open());
  EXPECT_NE(told.find("0xffff [identity register]; expected 0x4056. Wrong chip select"), std::string::npos) << told;
}

TEST(Adis16470, AWrongChecksumIsLeftOut) {
  AdisRig rig(at_rate(200));
  ASSERT_EQ(text(rig.imu->open()), "well");
  rig.read_for(0.5);
  rig.model.spoil_checksum = true;
  rig.read_for(0.02);
  rig.model.spoil_checksum = false;
  rig.read_for(0.5);
  EXPECT_EQ(rig.compared().unknown, 0U);
  EXPECT_GE(rig.imu->counts().damaged, 3U);
  EXPECT_EQ(rig.imu->counts().disconnected, 0U);
  rig.model.spoil_checksum = true;
  rig.read_for(1);
  EXPECT_GE(rig.imu->counts().disconnected, 1U);
}

TEST(Adis16470, ABrownOutIsFoundAndMendedAndNothingWrongIsHandedOut) {
  AdisRig rig(at_rate(200));
  ASSERT_EQ(text(rig.imu->open()), "well");
  rig.read_for(1);
  rig.model.power_on();
  rig.read_for(2);
  rig.model.next_status = 1U << 4;  // the supply was below 2.8 V
  rig.read_for(2);
  const Comparison result = rig.compared();
  EXPECT_EQ(result.unknown, 0U);
  EXPECT_TRUE(rig.imu->is_running());
  EXPECT_GE(rig.model.resets, 3);
  EXPECT_LT(result.worst_late_ns + result.worst_early_ns, 30'000);
  EXPECT_GT(result.samples, 700U);
}

TEST(Adis16470, WhicheverRegisterChangesIsFoundAndSetAgain) {
  for (const auto& [address, bit] : {std::pair{0x5C, 1}, {0x60, 0x40}, {0x64, 1}}) {
    SCOPED_TRACE(address);
    AdisRig rig(at_rate(200));
    ASSERT_EQ(text(rig.imu->open()), "well");
    rig.read_for(0.3);
    auto& changed = rig.model.reg(static_cast<std::uint8_t>(address));
    const auto before = changed;
    changed ^= static_cast<std::uint16_t>(bit);
    rig.read_for(4);
    EXPECT_EQ(rig.imu->counts().resets + rig.imu->counts().disconnected, 1U) << "it may be silence that tells";
    EXPECT_EQ(changed, before);
  }
}

TEST(Adis16470, ABusThatFailsIsReopened) {
  AdisRig rig(at_rate(200));
  ASSERT_EQ(text(rig.imu->open()), "well");
  rig.read_for(0.5);
  rig.bus->fail_next = 1;
  rig.read_for(1);
  EXPECT_EQ(rig.imu->counts().disconnected, 1U);
  EXPECT_TRUE(rig.imu->is_running());
  for (const int level : {0x00, 0xff}) {
    rig.bus->stuck = level;
    rig.read_for(2);
    EXPECT_FALSE(rig.imu->is_running()) << level;
    rig.bus->stuck = -1;
    rig.read_for(2);
    EXPECT_TRUE(rig.imu->is_running()) << level;
  }
  EXPECT_EQ(rig.compared().unknown, 0U);
}

TEST(Adis16470, BitErrorsGoIntoTheChecksum) {
  WorldSettings settings;
  settings.edge_jitter_us = 0;
  AdisRig rig(at_rate(200), true, settings);
  ASSERT_EQ(text(rig.imu->open()), "well");
  rig.bus->bit_error_rate = 1e-3;
  rig.read_for(30);
  const Comparison result = rig.compared();
  EXPECT_EQ(result.unknown, 0U);
  EXPECT_GT(result.samples, 5000U);
  EXPECT_LE(result.worst_late_ns, 100'000);
  EXPECT_LE(result.worst_early_ns, 100'000);
}

TEST(Adis16470, ReadingNeedsNoHeap) {
  if (!allocation_counting_available()) GTEST_SKIP() << "heap calls are not counted in this build";
  AdisRig rig(at_rate(200));
  ASSERT_EQ(text(rig.imu->open()), "well");
  rig.model.heap_calls = 0;
  rig.read_for(0.5);
  rig.model.next_status = 1U << 1;
  rig.read_for(0.5);
  rig.bus->fail_next = 1;
  rig.read_for(1);
  EXPECT_GT(rig.reading.samples.size(), 100U);
  EXPECT_EQ(rig.reading.heap_calls, rig.model.heap_calls);
}

TEST(AdisBurst, IsReadByHand) {
  std::vector<std::uint8_t> bytes{0x00, 0x08, 0x00, 0x0a, 0xff, 0xf6, 0x00, 0x00, 0x03, 0x20,
                                  0x80, 0x00, 0x00, 0x01, 0x00, 0xfa, 0x12, 0x34, 0x00, 0x00};
  unsigned sum = 0;
  for (std::size_t i = 0; i < 18; ++i) sum += bytes[i];
  bytes[18] = static_cast<std::uint8_t>(sum >> 8);
  bytes[19] = static_cast<std::uint8_t>(sum);
  AdisBurst burst;
  ASSERT_TRUE(parse_adis_burst(bytes, burst));
  EXPECT_EQ(burst.status, 8);
  EXPECT_EQ(burst.gyro, (std::array<std::int16_t, 3>{10, -10, 0}));
  EXPECT_EQ(burst.accel, (std::array<std::int16_t, 3>{800, -32768, 1}));
  EXPECT_DOUBLE_EQ(burst.temperature_c, 25);
  EXPECT_EQ(burst.counter, 0x1234);
  for (std::size_t i = 0; i < 20; ++i) {
    for (int bit = 0; bit < 8; ++bit) {
      std::vector<std::uint8_t> wrong = bytes;
      wrong[i] ^= static_cast<std::uint8_t>(1 << bit);
      EXPECT_FALSE(parse_adis_burst(wrong, burst));
    }
  }
  EXPECT_FALSE(parse_adis_burst(std::vector<std::uint8_t>(20, 0), burst));
}

}  // namespace
}  // namespace epiline
