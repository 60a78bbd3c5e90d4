#include "platform/concurrency/spsc_ring.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <deque>

#include "platform/memory/allocation_count.h"

namespace epiline {
namespace {

TEST(SpscRing, IsEmptyAtFirst) {
  SpscRing<int, 4> ring;
  int out = 7;
  EXPECT_EQ(ring.front(), nullptr);
  EXPECT_FALSE(ring.pop(out));
  EXPECT_EQ(out, 7);
  EXPECT_EQ(ring.high_water(), 0);
}

TEST(SpscRing, RefusesAndCountsWhenFull) {
  SpscRing<int, 2> ring;
  EXPECT_TRUE(ring.push(1));
  EXPECT_TRUE(ring.push(2));
  EXPECT_FALSE(ring.push(3));
  EXPECT_EQ(ring.claim(), nullptr);
  EXPECT_EQ(ring.dropped(), 2);
  int out = 0;
  ASSERT_TRUE(ring.pop(out));
  EXPECT_EQ(out, 1) << "a full ring keeps what it has";
  EXPECT_TRUE(ring.push(4));
  EXPECT_EQ(ring.high_water(), 2);
}

TEST(SpscRing, ElementsAreWrittenAndReadInPlace) {
  SpscRing<int, 2> ring;
  int* const slot = ring.claim();
  ASSERT_NE(slot, nullptr);
  EXPECT_EQ(ring.claim(), slot) << "claiming is not publishing";
  *slot = 5;
  EXPECT_EQ(ring.front(), nullptr) << "nobody sees a claimed element";
  ring.publish();
  EXPECT_EQ(ring.front(), slot);
  EXPECT_EQ(*ring.front(), 5);
}

TEST(SpscRing, HighWaterIsTheTrueMaximumNotTheStaleOne) {
  SpscRing<int, 8> ring;
  int out = 0;
  for (int i = 0; i < 100; ++i) {
    ASSERT_TRUE(ring.push(i));
    ASSERT_TRUE(ring.pop(out));
  }
  EXPECT_EQ(ring.high_water(), 1);
  for (int i = 0; i < 3; ++i) ring.push(i);
  EXPECT_EQ(ring.high_water(), 3);
}

TEST(SpscRing, SidesDoNotShareCacheLines) {
  EXPECT_EQ(alignof(SpscRing<char, 1>), kCacheLine);
  EXPECT_EQ(sizeof(SpscRing<char, 1>), 3 * kCacheLine);
}

TEST(SpscRing, UsesNoHeap) {
  const HeapCallScope heap;
  SpscRing<std::array<double, 100>, 8> ring;
  for (int i = 0; i < 20; ++i) ring.push({});
  EXPECT_EQ(heap.calls(), 0);
}

// Any sequence of operations, against a queue and plain counters.
RC_GTEST_PROP(SpscRing, BehavesLikeAQueueThatRefusesWhenFull, ()) {
  constexpr std::size_t kCapacity = 4;
  SpscRing<int, kCapacity> ring;
  std::deque<int> model;
  std::uint64_t dropped = 0;
  std::size_t high_water = 0;
  const auto operations = *rc::gen::container<std::vector<int>>(rc::gen::inRange(0, 1000));
  for (const int operation : operations) {
    if (operation % 5 < 3) {  // more pushes than pops: the ring must fill
      const bool room = model.size() < kCapacity;
      RC_ASSERT(ring.push(operation) == room);
      if (room) model.push_back(operation);
      if (!room) ++dropped;
      high_water = std::max(high_water, model.size());
    } else {
      int out = -1;
      RC_ASSERT(ring.pop(out) == !model.empty());
      if (!model.empty()) {
        RC_ASSERT(out == model.front());
        model.pop_front();
      }
    }
    RC_ASSERT(ring.dropped() == dropped);
    RC_ASSERT(ring.high_water() == high_water);
    RC_ASSERT(ring.published() - ring.popped() == model.size());
    RC_ASSERT((ring.front() == nullptr) == model.empty());
  }
}

}  // namespace
}  // namespace epiline
