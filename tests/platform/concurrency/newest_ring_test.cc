#include "platform/concurrency/newest_ring.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <deque>
#include <utility>
#include <vector>

namespace epiline {
namespace {

using Ring = NewestRing<4>;

TEST(NewestRing, IsInOrderAndCompleteWhileItDoesNotOverflow) {
  Ring ring;
  const auto nobody = [](Ring::Value) { FAIL() << "nothing is overtaken"; };
  EXPECT_FALSE(ring.ready());
  EXPECT_EQ(ring.pop(nobody), Ring::kNone);
  for (Ring::Value v = 0; v < 4; ++v) EXPECT_EQ(ring.push(v), Ring::kNone);
  for (Ring::Value v = 0; v < 4; ++v) {
    EXPECT_TRUE(ring.ready());
    EXPECT_EQ(ring.pop(nobody), v);
  }
  EXPECT_FALSE(ring.ready());
  EXPECT_EQ(ring.high_water(), 4);
}

TEST(NewestRing, AfterAnOverflowTheNewestComesAtOnce) {
  Ring ring;
  for (Ring::Value v = 0; v < 4; ++v) ring.push(v);
  EXPECT_EQ(ring.push(4), 0) << "the oldest leaves";
  EXPECT_EQ(ring.push(5), 1);
  std::vector<Ring::Value> overtaken;
  EXPECT_EQ(ring.pop([&](Ring::Value v) { overtaken.push_back(v); }), 5);
  std::sort(overtaken.begin(), overtaken.end());
  EXPECT_EQ(overtaken, (std::vector<Ring::Value>{2, 3, 4}));
  EXPECT_FALSE(ring.ready());
  ring.push(6);
  EXPECT_EQ(ring.pop([](Ring::Value) {}), 6) << "and then in order again";
  EXPECT_EQ(ring.evicted(), 2);
  EXPECT_EQ(ring.overtaken(), 3);
  EXPECT_EQ(ring.popped(), 2);
  EXPECT_EQ(ring.pushed(), 7);
}

// A producer that comes in the middle of a sweep: the visitor plays it. The sweep has passed cell 0 by then; the value
// pushed there must not be lost, and later values come all the same.
TEST(NewestRing, AValuePushedDuringASweepLeavesTheRingOnce) {
  Ring ring;
  for (Ring::Value v = 0; v < 5; ++v) ring.push(v);  // serial 1 evicted; cell of serial 1 holds serial 5
  std::vector<Ring::Value> out;
  int pushed = 0;
  const auto during = [&](Ring::Value v) {
    out.push_back(v);
    if (pushed++ > 0) return;
    EXPECT_EQ(ring.push(10), Ring::kNone);  // serial 6, into the cell that was swept just now
    const Ring::Value evicted = ring.push(11);
    if (evicted != Ring::kNone) out.push_back(evicted);
  };
  const Ring::Value best = ring.pop(during);
  out.push_back(best);
  EXPECT_EQ(best, 11) << "the newest that the sweep met";
  for (Ring::Value v = 12; v < 20; ++v) {
    const Ring::Value evicted = ring.push(v);
    if (evicted != Ring::kNone) out.push_back(evicted);
    const auto visit = [&](Ring::Value old) { out.push_back(old); };
    Ring::Value got = ring.pop(visit);
    if (got == Ring::kNone && ring.ready()) got = ring.pop(visit);
    if (got != Ring::kNone) out.push_back(got);
  }
  std::sort(out.begin(), out.end());
  EXPECT_EQ(out, (std::vector<Ring::Value>{1, 2, 3, 4, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19})) << "0 was evicted";
}

// Any sequence of operations, against a list with the policy spelled out.
RC_GTEST_PROP(NewestRing, BehavesLikeAListWhoseOldestLeaves, ()) {
  Ring ring;
  std::deque<std::uint64_t> model;  // serials that wait
  std::uint64_t pushed = 0, tail = 0, evicted = 0, overtaken = 0, popped = 0;
  std::size_t high_water = 0;
  const auto operations = *rc::gen::container<std::vector<int>>(rc::gen::inRange(0, 1000));
  for (const int operation : operations) {
    if (operation % 5 < 3) {
      const auto value = static_cast<Ring::Value>(++pushed);
      Ring::Value expected = Ring::kNone;
      if (!model.empty() && model.front() + Ring::capacity() == pushed) {
        expected = static_cast<Ring::Value>(model.front());
        model.pop_front();
        ++evicted;
      }
      model.push_back(pushed);
      high_water = std::max(high_water, std::min<std::size_t>(pushed - tail, Ring::capacity()));
      RC_ASSERT(ring.push(value) == expected);
    } else {
      std::uint64_t expected = Ring::kNone;
      if (!model.empty()) {
        const bool overflown = model.front() != tail + 1;
        expected = overflown ? model.back() : model.front();
        overtaken += overflown ? model.size() - 1 : 0;
        overflown ? model.clear() : model.pop_front();
        tail = expected;
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
