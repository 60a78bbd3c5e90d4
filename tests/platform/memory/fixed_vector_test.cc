#include "platform/memory/fixed_vector.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <vector>

namespace epiline {
namespace {

static_assert(std::is_trivially_copyable_v<FixedVector<int, 3>>, "travels through rings and logs");

TEST(FixedVector, ACopyHasTheElementsAndNoMore) {
  FixedVector<int, 4> from, to;
  for (const int x : {1, 2, 3}) to.push_back(x);
  for (const int x : {8, 9}) from.push_back(x);
  to.copy(from);
  EXPECT_EQ(std::vector<int>(to.begin(), to.end()), (std::vector<int>{8, 9}));
  EXPECT_EQ(to.data()[2], 3) << "beyond, nothing is written";
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
    RC_ASSERT(v.full() == (model.size() == kCapacity));
    if (!model.empty()) RC_ASSERT(v.back() == model.back());
  }
}

}  // namespace
}  // namespace epiline
