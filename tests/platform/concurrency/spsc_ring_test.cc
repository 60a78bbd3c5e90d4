#include "platform/concurrency/spsc_ring.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <deque>
#include <vector>

namespace epiline {
namespace {

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
      RC_ASSERT((ring.claim() != nullptr) == room);  // alone it changes nothing but the count of refusals
      if (!room) ++dropped;
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
