// What every chip on SPI must do, on its model. What only one of them does: the test of its name.
#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/drivers/sensors/imu/chip_rigs.h"

namespace epiline {
namespace {

using namespace epiline::test;

struct NameOfChip {
  template <class Rig>
  static std::string GetName(int) {
    return Rig(at_rate(Rig::kRate)).imu->facts().name;
  }
};

template <class Rig>
class EverySpiChip : public testing::Test {
 protected:
  /// A chip that is open and runs.
  void begin(bool has_line = true, const WorldSettings& world = {}, double clock_error = 0) {
    rig.emplace(at_rate(Rig::kRate), has_line, world);
    rig->set_clock_error(clock_error);
    rig->open();
  }
  void expect_stamps_within(std::int64_t limit_ns) const {
    const Comparison result = rig->compared();
    EXPECT_LE(result.worst_ns(), limit_ns);
  }
  static double samples_in(double seconds) { return seconds * Rig::kRate; }
  std::optional<Rig> rig;
};
using Rigs = testing::Types<AdisRig, BmiRig, IcmRig>;
TYPED_TEST_SUITE(EverySpiChip, Rigs, NameOfChip);

TYPED_TEST(EverySpiChip, GivesEverySampleOnceWithTheTimeOfItsEdge) {
  this->begin(true, {.edge_jitter_us = 0}, 0.008);
  this->rig->read_for(10);
  const Comparison result = this->rig->compared();
  EXPECT_GT(static_cast<double>(result.samples), 0.99 * this->samples_in(10));
  EXPECT_EQ(result.unknown + result.missing, 0U);
  EXPECT_LT(result.worst_accel_m_s2, TypeParam::kWorstAccel);
  this->expect_stamps_within(0);
  this->rig->expect_nothing_odd();
}

TYPED_TEST(EverySpiChip, RangesRatesAndEdgesAreAnyOfTheChips) {
  constexpr bool kHasFifo = TypeParam::kHasFifo;  // without one, a late reader loses samples
  rc::check("values and stamps", [] {
    ImuDeviceConfig config;
    config.rate_hz = *rc::gen::elementOf(TypeParam::kRates);
    config.gyroscope_range_deg_s = *rc::gen::elementOf(TypeParam::kGyroscopeRanges);
    config.accelerometer_range_m_s2 = *rc::gen::elementOf(TypeParam::kAccelerometerRanges);
    config.ready_edge = *rc::gen::element(0, 1);
    config.delay_ms = *rc::gen::element(0.0, 1.25);
    WorldSettings settings;
    settings.seed = *rc::gen::arbitrary<unsigned>();
    settings.edge_jitter_us = *rc::gen::inRange(0, 30);
    settings.edge_visible_us = kHasFifo ? *rc::gen::element(0, 0, 60) : 0;
    settings.edge_lost_share = kHasFifo ? 0 : *rc::gen::element(0.0, 0.05);
    settings.wake_up_us = *rc::gen::inRange(5, TypeParam::kSlowestWakeUp_us);
    settings.stall_share = *rc::gen::element(0.0, 0.02, kHasFifo ? 0.2 : 0.0);
    settings.stall_most_ms = *rc::gen::inRange(0, 15);
    TypeParam chip(config, true, settings);
    chip.set_clock_error(*rc::gen::inRange(-15, 16) * 1e-3);
    RC_ASSERT(text(chip.imu->open()) == "well");
    chip.read_for(2);
    const Comparison result = compare(chip.reading.samples, chip.model.truths,
                                      chip.imu->facts().gyroscope_delay + Span::from_seconds(config.delay_ms * 1e-3));
    RC_ASSERT(result.unknown + (kHasFifo ? result.missing : 0) == 0U);
    RC_ASSERT(static_cast<double>(result.samples) > (kHasFifo ? 0.9 : 0.6) * 2 * chip.imu->facts().rate_hz);
    RC_ASSERT(result.worst_early_ns <= (kHasFifo ? 40'000 : 60'000));
    RC_ASSERT(result.worst_late_ns <= 70'000);
    RC_ASSERT(result.worst_accel_m_s2 < TypeParam::kWorstAccel);
    RC_ASSERT(chip.reading.failed == 0U);
  });
}

TYPED_TEST(EverySpiChip, WithoutALineItIsPolledByItsOwnTime) {
  this->begin(false, {}, 0.007);
  this->rig->read_for(10);
  const Comparison result = this->rig->compared();
  EXPECT_EQ(result.unknown, 0U);
  EXPECT_LT(result.missing, TypeParam::kHasFifo ? 1U : 20U);
  EXPECT_GT(static_cast<double>(result.samples), 0.97 * this->samples_in(10));
  EXPECT_LT(result.worst_accel_m_s2, TypeParam::kWorstAccel);
  EXPECT_NEAR(this->rig->imu->clock_state().skew_ppm, -7000, 150);
  this->expect_stamps_within(TypeParam::kPolledWithin_ns);
}

TYPED_TEST(EverySpiChip, ABrownOutIsFoundAndMendedAndNothingWrongIsHandedOut) {
  for (const bool whole : {true, false}) {
    this->begin();
    this->rig->read_for(1);
    for (int i = 0; i < 4; ++i) {
      this->rig->brown_out(whole);
      this->rig->read_for(2);
    }
    const Comparison result = this->rig->compared();
    EXPECT_TRUE(this->rig->imu->is_running()) << whole;
    const SpiImuCounts counts = this->rig->imu->counts();
    EXPECT_EQ(counts.resets + (TypeParam::kHasFifo ? 0 : counts.disconnected), 4U) << "or silence tells; " << whole;
    EXPECT_EQ(result.unknown, 0U) << whole;
    EXPECT_GT(static_cast<double>(result.samples), 0.7 * this->samples_in(9)) << whole;
    EXPECT_LT(result.worst_accel_m_s2, TypeParam::kWorstAccel);
    this->expect_stamps_within(20'000);
  }
}

// Each register that it sets but power management and the bank.
TYPED_TEST(EverySpiChip, WhicheverRegisterChangesIsFoundAndSetAgain) {
  for (const RegisterBit& r : TypeParam::kRegisters) {
    SCOPED_TRACE(testing::Message() << "bank " << r.bank << ", register " << r.address);
    this->begin();
    this->rig->read_for(0.3);
    auto& changed = this->rig->reg(r);
    const auto before = changed;
    changed = static_cast<std::remove_cvref_t<decltype(changed)>>(changed ^ r.bit);
    this->rig->read_for(4);
    const SpiImuCounts counts = this->rig->imu->counts();
    EXPECT_EQ(counts.resets + counts.disconnected, 1U) << "it may be silence that tells";
    EXPECT_EQ(changed, before);
    EXPECT_GT(counts.checked, 5U);
  }
}

TYPED_TEST(EverySpiChip, ABusThatFailsOrGetsStuckIsReopened) {
  this->begin();
  this->rig->read_for(0.5);
  for (ModelBus* const bus : this->rig->buses()) {
    bus->fail_next = 1;
    this->rig->read_for(1);
  }
  EXPECT_EQ(this->rig->imu->counts().disconnected, this->rig->buses().size());
  EXPECT_EQ(this->rig->imu->counts().last_error, EIO);
  EXPECT_TRUE(this->rig->imu->is_running());
  for (ModelBus* const bus : this->rig->buses()) {
    for (const int level : {0x00, 0xff}) {
      bus->stuck = level;
      this->rig->read_for(2);
      EXPECT_FALSE(this->rig->imu->is_running()) << level;
      bus->stuck = -1;
      this->rig->read_for(2);
      EXPECT_TRUE(this->rig->imu->is_running()) << level;
    }
  }
  EXPECT_EQ(this->rig->compared().unknown, 0U);
}

TYPED_TEST(EverySpiChip, FifosThatRanOverAreEmptied) {
  this->begin();
  for (const std::int64_t stall_ms : TypeParam::kStalls_ms) {
    this->rig->read_for(1);
    this->rig->stall(stall_ms);
  }
  this->rig->read_for(1);
  const Comparison result = this->rig->compared();
  EXPECT_EQ(result.unknown, 0U);
  EXPECT_EQ(this->rig->imu->counts().overflows, TypeParam::kHasFifo ? 1U : 0U);
  EXPECT_GE(this->rig->imu->counts().lost, TypeParam::kHasFifo ? 100U : 0U);
  EXPECT_LT(result.worst_accel_m_s2, TypeParam::kWorstAccel);
  this->expect_stamps_within(20'000);
  const auto seconds = static_cast<double>(TypeParam::kStalls_ms.size()) + 1;
  EXPECT_GT(static_cast<double>(result.samples), 0.93 * this->samples_in(seconds));
}

TYPED_TEST(EverySpiChip, BitErrorsNeitherHangNorShiftTheTime) {
  this->begin(true, {.edge_jitter_us = 0});
  for (ModelBus* const bus : this->rig->buses()) bus->bit_error_rate = TypeParam::kBitErrorRate;
  this->rig->read_for(20);
  for (ModelBus* const bus : this->rig->buses()) bus->bit_error_rate = 0;
  this->rig->read_for(1);
  const SpiImuCounts counts = this->rig->imu->counts();
  EXPECT_GT(counts.damaged + counts.resets, 0U);
  this->rig->reading.samples.clear();
  this->rig->read_for(2);
  const Comparison result = this->rig->compared();
  EXPECT_GT(static_cast<double>(result.samples), 0.9 * this->samples_in(2));
  EXPECT_EQ(result.unknown, 0U);
  EXPECT_LT(result.worst_accel_m_s2, TypeParam::kWorstAccel);
  this->expect_stamps_within(0);
}

TYPED_TEST(EverySpiChip, ReadingNeedsNoHeap) {
  if (!allocation_counting_available()) GTEST_SKIP() << "heap calls are not counted in this build";
  this->begin(true, {.edge_lost_share = 0.1});
  this->rig->model.heap_calls = 0;
  this->rig->read_for(0.5);
  this->rig->brown_out(true);
  this->rig->read_for(1);
  this->rig->buses().front()->fail_next = 1;
  this->rig->read_for(1);
  EXPECT_GT(static_cast<double>(this->rig->reading.samples.size()), 0.3 * this->samples_in(2.5));
  EXPECT_EQ(this->rig->imu->counts().resets + this->rig->imu->counts().disconnected, 2U);
  EXPECT_EQ(this->rig->reading.heap_calls, this->rig->model.heap_calls);
}

// ---- each by its data sheet ----

TEST(SpiChips, DelaysAreThoseOfTheFiltersAsSet) {
  const auto filter_s = [](double hz) { return std::sqrt(2.0) / (2 * std::numbers::pi * hz); };  // of second order
  const auto gyroscope_s = [](const auto& rig) { return rig.imu->facts().gyroscope_delay.seconds(); };
  EXPECT_NEAR(gyroscope_s(AdisRig(at_rate(200))), 1.44e-3 + 2.25e-3, 1e-9) << "the decimation's";
  EXPECT_NEAR(gyroscope_s(AdisRig(at_rate(2000))), 1.44e-3, 1e-9);
  const BmiRig bmi(at_rate(400));
  EXPECT_NEAR(gyroscope_s(bmi), filter_s(47), 1e-6);
  EXPECT_NEAR(bmi.imu->facts().accelerometer_delay.seconds(), filter_s(75), 1e-6);
  // DS-000347: 3.3 ms of the UI filter at 200 Hz; the anti-alias filter at 213 Hz
  EXPECT_NEAR(gyroscope_s(IcmRig(at_rate(200))), 3.3e-3 + filter_s(213), 1e-6);
}

template <class Rig>
void expect_told(void (*fault)(Rig&), const std::string& expected) {
  Rig rig(at_rate(Rig::kRate));
  fault(rig);
  const std::string told = text(rig.imu->open());
  EXPECT_NE(told.find(expected), std::string::npos) << told;
}

TEST(SpiChips, SayWhoIsThereInstead) {
  expect_told<AdisRig>([](AdisRig& rig) { rig.model.reg(0x72) = 16475; },
                       "an ADIS16475 [identity register]; expected 0x4056");
  expect_told<AdisRig>([](AdisRig& rig) { rig.bus->stuck = 0xff; },
                       "0xffff [identity register]; expected 0x4056. Wrong chip select");
  expect_told<BmiRig>([](BmiRig& rig) { rig.accel_bus->stuck = 0xff; },
                      "wrong identity 0xff [identity register of the accelerometer]; expected 0x1e");
  expect_told<BmiRig>([](BmiRig& rig) { rig.gyro_bus->stuck = 0; },
                      "wrong identity 0x00 [identity register of the gyroscope]");
  expect_told<IcmRig>([](IcmRig& rig) { rig.bus->stuck = 0x00; }, "MISO not connected");
  expect_told<IcmRig>([](IcmRig& rig) { rig.bus->stuck = 0xff; }, "Wrong chip select");
  expect_told<IcmRig>([](IcmRig& rig) { rig.model.reg(0, 0x75) = 0x1e; },
                      "0x1e, the accelerometer of a BMI088 [identity register]; expected 0x47");
  expect_told<IcmRig>([](IcmRig& rig) { rig.model.reg(0, 0x75) = 0x23; }, "shifted by one");
  expect_told<IcmRig>([](IcmRig& rig) { rig.bus->open_error = ENOENT; }, "No such file");
  const std::string told = text(BmiRig(at_rate(400), true, {}, true).imu->open());
  EXPECT_NE(told.find("imu.device and imu.device_accel swapped"), std::string::npos) << told;
}

}  // namespace
}  // namespace epiline
