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

}  // namespace
}  // namespace epiline
