#include "pipeline/text/nearest.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

namespace epiline {
namespace {

TEST(EditDistance, CountsLettersAddedRemovedAndChanged) {
  EXPECT_EQ(edit_distance("kitten", "sitting"), 3u);  // the textbooks' example
  EXPECT_EQ(edit_distance("", "abc"), 3u);
  EXPECT_EQ(edit_distance("flaw", "lawn"), 2u);
}

TEST(EditDistance, IsADistance) {
  const bool holds = rc::check([](const std::string& a, const std::string& b, const std::string& c) {
    RC_ASSERT((edit_distance(a, b) == 0) == (a == b));
    RC_ASSERT(edit_distance(a, b) == edit_distance(b, a));
    RC_ASSERT(edit_distance(a, c) <= edit_distance(a, b) + edit_distance(b, c));
  });
  EXPECT_TRUE(holds);
}

TEST(Nearest, FindsWhatWasMeantAndNothingElse) {
  const std::vector<std::string> commands = {"run", "replay", "check", "hil"};
  EXPECT_EQ(nearest("replya", commands), "replay");
  EXPECT_EQ(nearest("chek", commands), "check");
  EXPECT_EQ(nearest("fly", commands), "");
  EXPECT_EQ(nearest("", commands), "");
  EXPECT_EQ(nearest("run", {}), "");
}

}  // namespace
}  // namespace epiline
