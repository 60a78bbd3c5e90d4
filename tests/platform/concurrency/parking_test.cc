#include "platform/concurrency/parking.h"

#include <gtest/gtest.h>

#include "platform/time/monotonic.h"

namespace epiline {
namespace {

constexpr std::int64_t kLong_ns = 5'000'000'000;

TEST(Parking, WhatIsThereIsNotWaitedFor) {
  Parking parking;
  EXPECT_TRUE(parking.wait_until(0, [] { return true; }));
  EXPECT_EQ(parking.slept(), 0);
}

TEST(Parking, EndsAtItsDeadline) {
  Parking parking;
  const std::int64_t deadline = monotonic_ns() + 20'000'000;
  EXPECT_FALSE(parking.wait_until(deadline, [] { return false; }));
  EXPECT_GE(monotonic_ns(), deadline);
  EXPECT_EQ(parking.timeouts(), 1);
  EXPECT_FALSE(parking.wait_until(deadline, [] { return false; })) << "a deadline that has passed";
}

// The two places at which a producer can come between the reader's looks, made certain: `ready` itself plays the
// producer. If the wake-up were lost, the wait would end at its deadline.
TEST(Parking, APublicationBeforeTheAnnouncementIsSeenByTheSecondLook) {
  Parking parking;
  int looks = 0;
  bool published = false;
  const std::int64_t began = monotonic_ns();
  EXPECT_TRUE(parking.wait_until(began + kLong_ns, [&] {
    if (++looks > 1) return published;
    published = true;
    parking.notify();
    return false;  // this look came before the publication
  }));
  EXPECT_EQ(looks, 2);
  EXPECT_LT(monotonic_ns() - began, kLong_ns);
  EXPECT_EQ(parking.slept(), 0);
}

TEST(Parking, APublicationAfterTheSecondLookKeepsTheReaderFromSleeping) {
  Parking parking;
  int looks = 0;
  bool published = false;
  const std::int64_t began = monotonic_ns();
  EXPECT_TRUE(parking.wait_until(began + kLong_ns, [&] {
    if (++looks != 2) return published;
    published = true;
    parking.notify();
    return false;
  }));
  EXPECT_EQ(looks, 3);
  EXPECT_LT(monotonic_ns() - began, kLong_ns);
}

TEST(Parking, ANotificationWithoutAReasonWakesNobodyForGood) {
  Parking parking;
  for (int i = 0; i < 10; ++i) parking.notify();
  EXPECT_FALSE(parking.wait_until(monotonic_ns() + 5'000'000, [] { return false; }));
}

}  // namespace
}  // namespace epiline
