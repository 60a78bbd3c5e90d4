#include "pipeline/watch/health_merge.h"

#include <gtest/gtest.h>

namespace epiline {
namespace {

constexpr Health kGood{HealthState::kTracking, 0, 90};
HostStamp at(int ms) { return HostStamp{1'000'000'000'000LL + ms * 1'000'000LL}; }

TEST(HealthMerge, AReasonDegradesAtOnceAndHoldsForHalfASecond) {
  HealthMerge merge;
  EXPECT_EQ(merge.step(kGood, 0, at(0)).state, HealthState::kTracking);
  Health h = merge.step(kGood, bit(HealthReason::kImagesFrozen), at(100));
  EXPECT_EQ(h.state, HealthState::kDegraded);
  EXPECT_EQ(h.reasons, bit(HealthReason::kImagesFrozen));
  EXPECT_LE(h.quality, 50);
  h = merge.step(kGood, 0, at(550));
  EXPECT_EQ(h.state, HealthState::kDegraded);
  EXPECT_EQ(h.reasons, bit(HealthReason::kImagesFrozen)) << "never degraded without a reason";
  h = merge.step(kGood, 0, at(650));
  EXPECT_EQ(h.state, HealthState::kTracking);
  EXPECT_EQ(h.reasons, 0U);
}

TEST(HealthMerge, ANoteIsSaidAndDoesNotDegrade) {
  HealthMerge merge;
  const Health h = merge.step(kGood, bit(HealthReason::kExposureStep), at(0));
  EXPECT_EQ(h.state, HealthState::kTracking);
  EXPECT_EQ(h.reasons, bit(HealthReason::kExposureStep));
}

TEST(HealthMerge, TheEstimatorsWorseVerdictStands) {
  HealthMerge merge;
  Health h = merge.step({HealthState::kLost, bit(HealthReason::kScaleUnknown), -1}, 0, at(0));
  EXPECT_EQ(h.state, HealthState::kLost);
  EXPECT_EQ(h.quality, -1);
  h = merge.step({HealthState::kInitialising, bit(HealthReason::kPosteriorWide), 10}, bit(HealthReason::kImuStuck),
                 at(50));
  EXPECT_EQ(h.state, HealthState::kInitialising);
  EXPECT_EQ(h.reasons, bit(HealthReason::kPosteriorWide) | bit(HealthReason::kImuStuck));
  h = merge.step(kGood, 0, at(100));
  EXPECT_EQ(h.state, HealthState::kDegraded) << "not good for long enough";
}

TEST(HealthMerge, QualityFallsAtOnceAndRisesSlowly) {
  HealthMerge merge;
  EXPECT_EQ(merge.step(kGood, 0, at(0)).quality, 90);
  EXPECT_EQ(merge.step({HealthState::kTracking, 0, 40}, 0, at(50)).quality, 40);
  int last = 40;
  for (int ms = 100; ms < 1000; ms += 50) {
    const int now = merge.step(kGood, 0, at(ms)).quality;
    EXPECT_GE(now, last);
    EXPECT_LE(now, last + 6);
    last = now;
  }
  EXPECT_GT(last, 75);
}

TEST(Silence, IsCountedInUsualPeriods) {
  LastHeard heard;
  EXPECT_EQ(silent_sensors(heard, at(0)), 0U) << "nothing has ever come: it may have to start";
  for (int ms = 0; ms <= 1000; ms += 50) heard.heard_image(at(ms));
  for (int ms = 0; ms <= 1000; ms += 5) heard.heard_imu(at(ms));
  EXPECT_EQ(silent_sensors(heard, at(1025)), 0U);
  EXPECT_EQ(silent_sensors(heard, at(1060)), bit(HealthReason::kImuSilent));
  EXPECT_EQ(silent_sensors(heard, at(1160)), bit(HealthReason::kImuSilent) | bit(HealthReason::kCameraSilent));
}

TEST(Silence, OfAFastSensorIsNotCountedBeforeABusyComputerCouldHaveHeardIt) {
  LastHeard heard;
  heard.heard_image(at(1000));
  heard.heard_imu(at(1000));
  EXPECT_EQ(silent_sensors(heard, at(1050)), 0U);
  EXPECT_EQ(silent_sensors(heard, at(1051)), bit(HealthReason::kImuSilent));
  EXPECT_EQ(silent_sensors(heard, at(1120)), bit(HealthReason::kImuSilent));
  EXPECT_EQ(silent_sensors(heard, at(1121)), bit(HealthReason::kImuSilent) | bit(HealthReason::kCameraSilent));
}

TEST(Silence, DegradesAndThenLoses) {
  LastHeard heard;
  heard.heard_image(at(1000));
  heard.heard_imu(at(1000));
  EXPECT_EQ(with_silence(kGood, heard, at(1010)).state, HealthState::kTracking);
  Health h = with_silence(kGood, heard, at(1400));
  EXPECT_EQ(h.state, HealthState::kDegraded);
  EXPECT_LE(h.quality, 50);
  EXPECT_EQ(h.reasons, bit(HealthReason::kImuSilent) | bit(HealthReason::kCameraSilent));
  EXPECT_EQ(with_silence(kGood, heard, at(1500)).state, HealthState::kDegraded);
  EXPECT_EQ(with_silence(kGood, heard, at(1501)).state, HealthState::kLost);
  h = with_silence(kGood, heard, at(1600));
  EXPECT_EQ(h.state, HealthState::kLost) << "without an IMU nothing can be said";
  EXPECT_EQ(h.quality, -1);
  heard.heard_imu(at(2900));
  EXPECT_EQ(with_silence(kGood, heard, at(2900)).state, HealthState::kDegraded) << "the IMU carries it";
  heard.heard_imu(at(3000));
  EXPECT_EQ(with_silence(kGood, heard, at(3000)).state, HealthState::kDegraded);
  EXPECT_EQ(with_silence(kGood, heard, at(3001)).state, HealthState::kLost);
  heard.heard_imu(at(3100));
  EXPECT_EQ(with_silence(kGood, heard, at(3100)).state, HealthState::kLost);
  EXPECT_EQ(with_silence({}, heard, at(3100)).state, HealthState::kInitialising);
}

}  // namespace
}  // namespace epiline
