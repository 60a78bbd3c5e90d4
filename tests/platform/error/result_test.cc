#include "platform/error/result.h"

#include <gtest/gtest.h>

#include <string>

namespace epiline {
namespace {

Result<int> half(int n) {
  if (n % 2 != 0)
    return Error{ErrorKind::kUsage, "numbers.txt", 3, std::string("odd number ").append(std::to_string(n)),
                 "an even one"};
  return n / 2;
}

TEST(Result, HoldsTheValueOrTheError) {
  const Result<int> good = half(8);
  ASSERT_TRUE(good);
  EXPECT_EQ(*good, 4);
  const Result<int> bad = half(7);
  ASSERT_FALSE(bad);
  EXPECT_EQ(bad.error().kind, ErrorKind::kUsage);
  EXPECT_EQ(bad.error().text(), "numbers.txt:3: odd number 7; expected an even one");
}

TEST(Result, ErrorTextLeavesOutWhatIsUnknown) {
  EXPECT_EQ((Error{ErrorKind::kRun, "", 0, "no images", ""}.text()), "no images");
  EXPECT_EQ((Error{ErrorKind::kRun, "mav0", 0, "missing", "a folder"}.text()), "mav0: missing; expected a folder");
  EXPECT_EQ((Error{ErrorKind::kRun, "", 0, "x", "y"}.text()), "x; expected y");
}

TEST(Result, ReadingTheWrongHalfThrowsInsteadOfInventing) {
  EXPECT_THROW((void)*half(7), std::bad_variant_access);
  EXPECT_THROW((void)half(8).error(), std::bad_variant_access);
}

}  // namespace
}  // namespace epiline
