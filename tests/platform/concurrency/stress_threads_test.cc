#include <gtest/gtest.h>

#include "tests/platform/concurrency/stress.h"

namespace epiline {
namespace {

using stress::Numbered;

template <class Ring>
class RingStress : public ::testing::Test {};

// The smallest rings have the most contention for one slot.
using Rings = ::testing::Types<SpscRing<Numbered, 1>, SpscRing<Numbered, 2>, SpscRing<Numbered, 64>>;
TYPED_TEST_SUITE(RingStress, Rings);

TYPED_TEST(RingStress, EveryElementArrivesOnceWholeAndInOrder) {
  TypeParam ring;
  constexpr std::uint64_t kCount = 20000;
  const stress::RingOutcome outcome = stress::through_ring(ring, kCount);
  EXPECT_EQ(outcome.wrong, 0);
  EXPECT_EQ(outcome.received, kCount);
  EXPECT_EQ(ring.published(), kCount);
  EXPECT_EQ(ring.popped(), kCount);
  EXPECT_EQ(ring.dropped(), outcome.refused);
  EXPECT_GE(ring.high_water(), 1);
  EXPECT_LE(ring.high_water(), ring.capacity());
  EXPECT_EQ(ring.front(), nullptr);
}

TEST(LatestValueStress, ValuesAreWholeAndNeverOlder) {
  LatestValue<Numbered> box;
  constexpr std::uint64_t kCount = 50000;
  const stress::BoxOutcome outcome = stress::through_box(box, kCount);
  EXPECT_EQ(outcome.wrong, 0);
  EXPECT_EQ(outcome.last, kCount);
}

class SlotStress : public ::testing::TestWithParam<std::size_t> {};

// From the fewest slots with which anything moves to as many as let the ring overflow all the time.
INSTANTIATE_TEST_SUITE_P(Slots, SlotStress, ::testing::Values(2, 3, 4, 6, 8));

TEST_P(SlotStress, PayloadsAreWholeAndTheProducerNeverStarves) {
  NewestRing<4> ring;
  stress::Lender<8, SoundOrders> lender(GetParam());
  constexpr std::uint64_t kCount = 5000;
  const stress::SlotOutcome outcome = stress::SlotTraffic(ring, lender, kCount).run();
  EXPECT_EQ(outcome.wrong, 0);
  EXPECT_EQ(outcome.late, 0) << "a wake-up was lost";
  EXPECT_EQ(outcome.starved, 0) << "the consumer had caught up and slots did not come back";
  EXPECT_EQ(ring.pushed(), kCount);
  EXPECT_EQ(ring.popped(), outcome.received);
  EXPECT_EQ(ring.popped() + ring.evicted() + ring.overtaken(), kCount);
  EXPECT_EQ(lender.number_lent(), 0);
  for (std::size_t slot = 0; slot < 8; ++slot) EXPECT_EQ(lender.loans.users(slot), 0);
}

// One element at a time, both sides asleep in turn: every wait depends on a wake-up.
TEST(ParkingStress, NoWakeUpIsLost) {
  constexpr std::uint64_t kRounds = 20000;
  constexpr std::int64_t kDeadline_ns = 5'000'000'000;
  SpscRing<std::uint64_t, 1> there, back;
  Parking parked_there, parked_back;
  std::uint64_t lost = 0;
  const auto receive = [](auto& ring, Parking& parking) {
    std::uint64_t value = 0;
    parking.wait_until(monotonic_ns() + kDeadline_ns, [&] { return ring.front() != nullptr; });
    ring.pop(value);
    return value;
  };
  std::thread echo([&] {
    for (std::uint64_t i = 1; i <= kRounds; ++i) {
      back.push(receive(there, parked_there));
      parked_back.notify();
    }
  });
  for (std::uint64_t i = 1; i <= kRounds; ++i) {
    there.push(i);
    parked_there.notify();
    if (receive(back, parked_back) != i) ++lost;
  }
  echo.join();
  EXPECT_EQ(lost, 0);
  EXPECT_EQ(parked_there.timeouts() + parked_back.timeouts(), 0);
  EXPECT_GT(parked_back.slept(), 0);
}

}  // namespace
}  // namespace epiline
