#include "platform/concurrency/latest_value.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <optional>
#include <vector>

namespace epiline {
namespace {

TEST(LatestValue, HasNothingBeforeTheFirstWrite) {
  LatestValue<int> box;
  EXPECT_EQ(box.read(), nullptr);
  box.draft() = 3;
  EXPECT_EQ(box.read(), nullptr) << "a draft is not a value";
}

TEST(LatestValue, AValueInHandStaysWhileTheWriterGoesOn) {
  LatestValue<int> box;
  box.write(1);
  const int* const held = box.read();
  for (int i = 2; i < 10; ++i) {
    box.write(i);
    EXPECT_EQ(*held, 1);
  }
  EXPECT_EQ(*box.read(), 9);
}

RC_GTEST_PROP(LatestValue, BehavesLikeAVariable, ()) {
  LatestValue<int> box;
  std::optional<int> model;
  const auto operations = *rc::gen::container<std::vector<int>>(rc::gen::inRange(0, 1000));
  for (const int operation : operations) {
    if (operation % 2 == 0) {
      box.write(operation);
      model = operation;
    } else {
      const int* const value = box.read();
      RC_ASSERT((value != nullptr) == model.has_value());
      if (value != nullptr) RC_ASSERT(*value == *model);
    }
  }
}

}  // namespace
}  // namespace epiline
