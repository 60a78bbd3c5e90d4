#include "platform/concurrency/slot_pool.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <vector>

namespace epiline {
namespace {

TEST(SlotPool, LendsEachSlotOnceAndSaysWhenThereIsNone) {
  SlotPool<8> pool(3);
  EXPECT_EQ(pool.take(), 0);
  EXPECT_EQ(pool.take(), 1);
  EXPECT_EQ(pool.take(), 2);
  EXPECT_EQ(pool.take(), SlotPool<8>::kNone);
  EXPECT_EQ(pool.exhausted(), 1);
  pool.give_back(1);
  EXPECT_EQ(pool.take(), 1);
  EXPECT_EQ(pool.high_water(), 3);
}

TEST(SlotPool, TheLastReaderFreesIt) {
  SlotPool<1> pool;
  ASSERT_EQ(pool.take(), 0);
  pool.share(0);
  pool.give_back(0);
  EXPECT_EQ(pool.take(), SlotPool<1>::kNone);
  pool.give_back(0);
  EXPECT_EQ(pool.take(), 0);
}

// Any sequence of operations, against a plain list of users.
RC_GTEST_PROP(SlotPool, BehavesLikeAListOfUsers, ()) {
  constexpr std::size_t kSlots = 4;
  SlotPool<kSlots> pool;
  std::vector<std::uint32_t> model(kSlots, 0);
  std::size_t high_water = 0;
  std::uint64_t exhausted = 0;
  const auto operations = *rc::gen::container<std::vector<int>>(rc::gen::inRange(0, 1000));
  for (const int operation : operations) {
    const auto slot = static_cast<std::size_t>(operation / 4) % kSlots;
    if (operation % 4 < 2) {
      const bool room = std::count(model.begin(), model.end(), 0U) > 0;
      const int taken = pool.take();
      RC_ASSERT((taken >= 0) == room);
      if (room) {
        RC_ASSERT(model[static_cast<std::size_t>(taken)] == 0U);
        model[static_cast<std::size_t>(taken)] = 1;
      }
      exhausted += room ? 0 : 1;
      high_water = std::max(high_water, kSlots - static_cast<std::size_t>(std::count(model.begin(), model.end(), 0U)));
    } else if (model[slot] > 0) {
      if (operation % 4 == 2) {
        pool.share(static_cast<int>(slot));
        ++model[slot];
      } else {
        pool.give_back(static_cast<int>(slot));
        --model[slot];
      }
    }
    for (std::size_t i = 0; i < kSlots; ++i) RC_ASSERT(pool.users(static_cast<int>(i)) == model[i]);
    RC_ASSERT(pool.high_water() == high_water);
    RC_ASSERT(pool.exhausted() == exhausted);
  }
}

}  // namespace
}  // namespace epiline
