#include "platform/memory/fixed_vector.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <vector>

#include "platform/memory/allocation_count.h"

namespace epiline {
namespace {

static_assert(std::is_trivially_copyable_v<FixedVector<int, 3>>, "travels through rings and logs");

TEST(FixedVector, AFullOneRefusesAndStaysAsItIs) {
  FixedVector<int, 2> v;
  EXPECT_TRUE(v.push_back(1));
  EXPECT_TRUE(v.push_back(2));
  EXPECT_TRUE(v.full());
  EXPECT_FALSE(v.push_back(3));
  EXPECT_EQ(v.size(), 2);
  EXPECT_EQ(v.back(), 2);
}

TEST(FixedVector, GrowsWithFreshElementsAndIsCutAtItsCapacity) {
  FixedVector<int, 4> v;
  v.push_back(7);
  v.push_back(8);
  v.resize(1);
  v.resize(9);
  EXPECT_EQ(std::vector<int>(v.begin(), v.end()), (std::vector<int>{7, 0, 0, 0}));
}

TEST(FixedVector, ACopyHasTheElementsAndNoMore) {
  FixedVector<int, 4> from, to;
  for (const int x : {1, 2, 3}) to.push_back(x);
  for (const int x : {8, 9}) from.push_back(x);
  to.copy(from);
  EXPECT_EQ(std::vector<int>(to.begin(), to.end()), (std::vector<int>{8, 9}));
  EXPECT_EQ(to.data()[2], 3) << "beyond, nothing is written";
}

TEST(FixedVector, UsesNoHeap) {
  const HeapCallScope heap;
  FixedVector<double, 100> v;
  while (v.push_back(1)) {
  }
  EXPECT_EQ(v.size(), v.capacity());
  EXPECT_EQ(heap.calls(), 0);
}

RC_GTEST_PROP(FixedVector, BehavesLikeAVectorThatRefuses, ()) {
  constexpr std::size_t kCapacity = 5;
  FixedVector<int, kCapacity> v;
  std::vector<int> model;
  for (const int operation : *rc::gen::container<std::vector<int>>(rc::gen::inRange(0, 1000))) {
    if (operation % 4 < 2) {
      RC_ASSERT(v.push_back(operation) == (model.size() < kCapacity));
      if (model.size() < kCapacity) model.push_back(operation);
    } else if (operation % 4 == 2) {
      const std::size_t n = static_cast<std::size_t>(operation / 4) % (kCapacity + 2);
      v.resize(n);
      model.resize(std::min(n, kCapacity));
    } else if (operation % 40 == 3) {
      v.clear();
      model.clear();
    }
    RC_ASSERT(std::equal(v.begin(), v.end(), model.begin(), model.end()));
    RC_ASSERT(v.empty() == model.empty());
  }
}

}  // namespace
}  // namespace epiline
