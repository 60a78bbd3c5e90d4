#include "drivers/links/mavlink/controller_height.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/drivers/links/mavlink/link_peer.h"

namespace epiline::mavlink {
namespace {

constexpr Address kFrom{1, 1};

class MavlinkControllerHeight : public ::testing::Test {
 protected:
  /// `ms` after the controller's 100 s, 2 ms on its way.
  template <class Message>
  bool take(const Message& message, std::int64_t ms) {
    const HostStamp now{kBoot_ns + 100 * kSecond + (ms + 2) * kMs};
    return heights.take(pack(message, kFrom, 0), clock, now, sample);
  }
  static std::uint32_t boot_ms(std::int64_t ms) { return static_cast<std::uint32_t>(100'000 + ms); }

  TwoWaySync clock = settled_clock(50);
  ControllerHeight heights{15};
  HeightSample sample;
};

TEST_F(MavlinkControllerHeight, TurnsPressureIntoHeightAndStampsByTheModel) {
  ASSERT_TRUE(take(ScaledPressure{.time_boot_ms = boot_ms(0), .press_abs = 1013.25F}, 0));
  EXPECT_NEAR(sample.metres, 0, 1e-3);
  EXPECT_EQ(sample.kind, HeightKind::kBarometer);
  EXPECT_NEAR(static_cast<double>(sample.stamp.ns), static_cast<double>(kBoot_ns + 100 * kSecond), 1e3);
  ASSERT_TRUE(take(ScaledPressure{.time_boot_ms = boot_ms(50), .press_abs = 1001.29F}, 50));
  EXPECT_NEAR(sample.metres, 100, 0.3);
  EXPECT_EQ(heights.counts().heights, 2U);
}

TEST_F(MavlinkControllerHeight, TakesTheFirstBarometerAsLongAsItComes) {
  ASSERT_TRUE(take(ScaledPressure2{.time_boot_ms = boot_ms(0), .press_abs = 1000}, 0));
  EXPECT_FALSE(take(Altitude{.time_usec = 100'010'000, .altitude_monotonic = 30}, 10));
  EXPECT_EQ(heights.counts().others, 1U);
  ASSERT_TRUE(take(Altitude{.time_usec = 102'500'000, .altitude_monotonic = 30}, 2500)) << "the other is silent";
  EXPECT_EQ(sample.metres, 30);
  EXPECT_FALSE(take(ScaledPressure3{.time_boot_ms = boot_ms(2510), .press_abs = 1000}, 2510));
}

TEST_F(MavlinkControllerHeight, TakesBeamsThatLookDown) {
  DistanceSensor down{.time_boot_ms = boot_ms(0),
                      .min_distance = 20,
                      .max_distance = 12'000,
                      .current_distance = 9876,
                      .orientation = 25};
  ASSERT_TRUE(take(down, 0));
  EXPECT_EQ(sample.kind, HeightKind::kRangeFinder);
  EXPECT_NEAR(sample.metres, 98.76, 1e-9);
  DistanceSensor ahead = down;
  ahead.time_boot_ms = boot_ms(50);
  ahead.orientation = 0;
  EXPECT_FALSE(take(ahead, 50));
  EXPECT_EQ(heights.counts().others, 1U);
  EXPECT_TRUE(take(ScaledPressure{.time_boot_ms = boot_ms(60), .press_abs = 1000}, 60))
      << "kinds do not hinder each other";
}

TEST_F(MavlinkControllerHeight, RefusesWhatNoSensorMeasures) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const float hpa : {nan, -1.0F, 0.0F, 99.0F, 1300.0F})
    EXPECT_FALSE(take(ScaledPressure{.time_boot_ms = boot_ms(0), .press_abs = hpa}, 0)) << hpa;
  for (const float metres : {nan, 2e5F})
    EXPECT_FALSE(take(Altitude{.time_usec = 100'000'000, .altitude_monotonic = metres}, 0)) << metres;
  DistanceSensor d{.time_boot_ms = boot_ms(0), .min_distance = 20, .max_distance = 5000, .orientation = 25};
  for (const int cm : {0, 20, 5000, 6000}) {
    d.current_distance = static_cast<std::uint16_t>(cm);
    EXPECT_FALSE(take(d, 0)) << cm;
  }
  d.current_distance = 1000;
  d.signal_quality = 1;
  EXPECT_FALSE(take(d, 0)) << "the sensor calls it invalid";
  EXPECT_EQ(heights.counts().refused_values, 12U);
  EXPECT_EQ(heights.counts().heights + heights.counts().distances, 0U);
}

TEST_F(MavlinkControllerHeight, RefusesTimesThatCannotBe) {
  ASSERT_TRUE(take(ScaledPressure{.time_boot_ms = boot_ms(0), .press_abs = 1000}, 0));
  EXPECT_FALSE(take(ScaledPressure{.time_boot_ms = boot_ms(0), .press_abs = 1001}, 10)) << "repeated";
  EXPECT_FALSE(take(ScaledPressure{.time_boot_ms = boot_ms(-900), .press_abs = 1001}, 20)) << "old";
  EXPECT_FALSE(take(ScaledPressure{.time_boot_ms = boot_ms(500), .press_abs = 1001}, 30)) << "ahead";
  EXPECT_FALSE(take(ScaledPressure{.time_boot_ms = 0xffffffff, .press_abs = 1001}, 40));
  EXPECT_EQ(heights.counts().refused_times, 4U);
  clock = settled_clock(9);
  EXPECT_FALSE(take(ScaledPressure{.time_boot_ms = boot_ms(50), .press_abs = 1001}, 50));
  EXPECT_EQ(heights.counts().no_clock, 1U);
}

TEST_F(MavlinkControllerHeight, AsksForWhatDoesNotCome) {
  HeightRequest request({true, true});
  std::int64_t now_ns = kBoot_ns + 100 * kSecond;
  const auto asked = [&] {
    now_ns = std::max(now_ns, request.due_ns());
    const auto question = request.question(heights, kFrom, now_ns);
    return question ? static_cast<int>(question->param1) : 0;
  };
  EXPECT_EQ(asked(), 29);
  EXPECT_EQ(asked(), 132);
  EXPECT_EQ(asked(), 141);
  EXPECT_EQ(asked(), 29);
  const auto ms = (now_ns - kBoot_ns) / kMs - 100'000;
  ASSERT_TRUE(take(ScaledPressure{.time_boot_ms = boot_ms(ms + 1'900), .press_abs = 1000}, ms + 1'900));
  EXPECT_EQ(asked(), 132) << "the barometer comes";
  EXPECT_FALSE(HeightRequest({false, false}).question(heights, kFrom, now_ns));
}

}  // namespace
}  // namespace epiline::mavlink
