#include "platform/concurrency/newest_ring.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <deque>
#include <vector>

namespace epiline {
namespace {

using Ring = NewestRing<4>;

TEST(NewestRing, AfterAnOverflowTheNewestComesAtOnce) {
  Ring ring;
  for (Ring::Value v = 0; v < 4; ++v) ring.push(v);
  EXPECT_EQ(ring.push(4), 0) << "the oldest leaves";
  EXPECT_EQ(ring.push(5), 1);
  std::vector<Ring::Value> overtaken;
  EXPECT_EQ(ring.pop([&](Ring::Value v) { overtaken.push_back(v); }), 5);
  EXPECT_EQ(overtaken, (std::vector<Ring::Value>{2, 3, 4}));
  EXPECT_FALSE(ring.ready());
  ring.push(6);
  EXPECT_EQ(ring.pop([](Ring::Value) {}), 6) << "and then in order again";
  EXPECT_EQ(ring.evicted(), 2);
  EXPECT_EQ(ring.overtaken(), 3);
  EXPECT_EQ(ring.popped(), 2);
  EXPECT_EQ(ring.pushed(), 7);
}

// A producer that comes while the consumer hands over what was overtaken: the visitor plays it. The ring is empty by
// then, so what is pushed waits for the next pops.
TEST(NewestRing, LeavesNothingBehindWhenAProducerComesDuringAPop) {
  Ring ring;
  for (Ring::Value v = 0; v < 5; ++v) ring.push(v);  // 0 is evicted
  std::vector<Ring::Value> overtaken;
  Ring::Value next = 10;
  const auto during = [&](Ring::Value v) {
    overtaken.push_back(v);
    EXPECT_EQ(ring.push(next++), Ring::kNone);
  };
  EXPECT_EQ(ring.pop(during), 4) << "the newest when the pop began";
  EXPECT_EQ(overtaken, (std::vector<Ring::Value>{1, 2, 3}));
  for (Ring::Value v = 10; v < 13; ++v) EXPECT_EQ(ring.pop(during), v);
  EXPECT_EQ(ring.pop(during), Ring::kNone);
  EXPECT_FALSE(ring.ready());
  EXPECT_EQ(ring.pushed(), ring.popped() + ring.evicted() + ring.overtaken());
}

TEST(NewestRing, CarriesTheSmallestAndTheLargestValueThroughAnOverflow) {
  Ring ring;
  for (const Ring::Value v : {Ring::Value{7}, Ring::kLargest, Ring::Value{0}, Ring::kLargest}) ring.push(v);
  EXPECT_EQ(ring.push(0), 7);
  std::vector<Ring::Value> overtaken;
  EXPECT_EQ(ring.pop([&](Ring::Value v) { overtaken.push_back(v); }), 0);
  EXPECT_EQ(overtaken, (std::vector<Ring::Value>{Ring::kLargest, 0, Ring::kLargest}));
}

// Any sequence of operations, against a list with the policy spelled out.
RC_GTEST_PROP(NewestRing, BehavesLikeAListWhoseOldestLeaves, ()) {
  Ring ring;
  std::deque<std::uint64_t> model;  // serials that wait
  bool overflown = false;
  std::uint64_t pushed = 0, evicted = 0, overtaken = 0, popped = 0;
  std::size_t high_water = 0;
  const auto operations = *rc::gen::container<std::vector<int>>(rc::gen::inRange(0, 1000));
  for (const int operation : operations) {
    if (operation % 5 < 3) {
      const auto value = static_cast<Ring::Value>(++pushed);
      Ring::Value expected = Ring::kNone;
      if (model.size() == Ring::capacity()) {
        expected = static_cast<Ring::Value>(model.front());
        model.pop_front();
        overflown = true;
        ++evicted;
      }
      model.push_back(pushed);
      high_water = std::max(high_water, model.size());
      RC_ASSERT(ring.push(value) == expected);
    } else {
      std::uint64_t expected = Ring::kNone;
      if (!model.empty()) {
        expected = overflown ? model.back() : model.front();
        overtaken += overflown ? model.size() - 1 : 0;
        overflown ? model.clear() : model.pop_front();
        overflown = false;
        ++popped;
      }
      RC_ASSERT(ring.pop([](Ring::Value) {}) == static_cast<Ring::Value>(expected));
    }
    RC_ASSERT(ring.ready() == !model.empty());
    RC_ASSERT(ring.evicted() == evicted);
    RC_ASSERT(ring.overtaken() == overtaken);
    RC_ASSERT(ring.popped() == popped);
    RC_ASSERT(ring.pushed() == popped + evicted + overtaken + model.size());
    RC_ASSERT(ring.high_water() == high_water);
  }
}

}  // namespace
}  // namespace epiline
