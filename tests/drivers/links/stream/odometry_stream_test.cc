#include "drivers/links/stream/odometry_stream.h"
#include "tests/support/times.h"

#include <gtest/gtest.h>

namespace epiline {
namespace {

/// Readings 5 ms apart over made-up time; what is due goes at once.
struct Flight {
  explicit Flight(double rate_hz) : stream(rate_hz) { o.health = {HealthState::kTracking, 0, 90}; }

  /// One reading offered, looked at, and sent if it is due. True: it was sent.
  bool step(bool is_open = true, bool has_image = false) {
    o.stamp.ns += 5 * kMs;
    now_ns += 5 * kMs;
    if (has_image) stream.offer_image(o);
    stream.offer(o, now_ns);
    return look(is_open);
  }
  bool look(bool is_open = true) {
    stream.look(now_ns, is_open);
    stream.count_dropped(now_ns, !is_open);
    if (!is_open || now_ns < stream.due_ns()) return false;
    EXPECT_EQ(stream.next().odometry.stamp, o.stamp);
    stream.begun(now_ns);
    stream.finished(now_ns);
    return true;
  }

  OdometryStream stream;
  Odometry o;
  std::int64_t now_ns = 1'000'000 * kMs;
};

TEST(OdometryStream, GivesAsManyAsAreWanted) {
  Flight flight(40);
  int sent = 0;
  for (int i = 0; i < 1'000; ++i) sent += flight.step() ? 1 : 0;
  EXPECT_NEAR(sent, 200, 2);
  EXPECT_EQ(flight.stream.dropped(), 0U);
}

TEST(OdometryStream, EachImageIsMeasuredOnce) {
  Flight flight(40);
  for (int i = 0; i < 1'000; ++i) flight.step(true, i % 3 == 0);  // more images than odometry
  EXPECT_NEAR(static_cast<double>(flight.stream.latency().count()), 334, 3);
  const std::uint64_t before = flight.stream.latency().count();
  for (int i = 0; i < 100; ++i) flight.step(false, i % 3 == 0);
  for (int i = 0; i < 100; ++i) flight.step();
  EXPECT_LE(flight.stream.latency().count(), before + 2) << "nobody waited for those of a way that was closed";
}

TEST(OdometryStream, SaysHowItIsBeforeTheFirstOffer) {
  OdometryStream stream(40);
  EXPECT_FALSE(stream.has_news());
  stream.look(kMs, true);
  EXPECT_EQ(stream.condition(), Condition::kWaiting);
  EXPECT_EQ(stream.health().quality, -1);
  EXPECT_GT(stream.due_ns(), 1'000'000 * kMs);
  EXPECT_GT(stream.silent_ns(), 1'000'000 * kMs);
}

TEST(OdometryStream, NothingLostOldOrSeenBeforeIsDue) {
  Flight flight(40);
  ASSERT_TRUE(flight.step());
  flight.o.health.state = HealthState::kLost;
  for (int i = 0; i < 50; ++i) EXPECT_FALSE(flight.step());
  EXPECT_EQ(flight.stream.condition(), Condition::kLost);
  const int resets = flight.stream.reset_counter();
  flight.o.health.state = HealthState::kDegraded;
  EXPECT_TRUE(flight.step());
  EXPECT_EQ(flight.stream.reset_counter(), (resets + 1) % 256) << "what drifted meanwhile is a jump";
  flight.now_ns += 50 * kMs;
  flight.stream.offer(flight.o, flight.now_ns);
  EXPECT_FALSE(flight.look()) << "the same again";
  flight.o.stamp.ns += 5 * kMs;
  flight.stream.offer(flight.o, flight.now_ns);
  flight.now_ns += OdometryStream::kTooOld_ns;
  EXPECT_FALSE(flight.look()) << "it has waited too long";
}

TEST(OdometryStream, SilenceIsToldAndEnds) {
  Flight flight(40);
  ASSERT_TRUE(flight.step());
  flight.o.health.reasons = bit(HealthReason::kFewTracks);
  flight.step();
  EXPECT_NE(flight.stream.reasons(), 0U);
  flight.now_ns = flight.stream.silent_ns() + 1;
  flight.look();
  EXPECT_EQ(flight.stream.condition(), Condition::kSilent);
  EXPECT_EQ(flight.stream.reasons(), 0U);
  const int resets = flight.stream.reset_counter();
  EXPECT_TRUE(flight.step());
  EXPECT_EQ(flight.stream.condition(), Condition::kGood);
  EXPECT_EQ(flight.stream.reset_counter(), (resets + 1) % 256);
}

TEST(OdometryStream, OneIsDroppedForEachPeriodTheWayWasClosed) {
  Flight flight(40);
  for (int i = 0; i < 100; ++i) flight.step();
  for (int i = 0; i < 100; ++i) flight.step(false);
  EXPECT_NEAR(static_cast<double>(flight.stream.dropped()), 20, 2);
  EXPECT_TRUE(flight.step());
}

}  // namespace
}  // namespace epiline
