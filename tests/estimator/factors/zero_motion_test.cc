// The factor of standing still: slope of its cost, which frames it ties, and what of it goes with the oldest frame.
// Derivation: docs/derivations/zero_motion.md.
#include "estimator/factors/zero_motion.h"

#include <gtest/gtest.h>

#include "tests/estimator/factors/named_blocks.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline::test {
namespace {

SyntheticWindow resting_window() {
  SyntheticWindow s = make_window({.frames = 5});
  Window& w = *s.window;
  for (const int k : {0, 3, 4}) w.at(k).at_rest = true;
  w.at(3).rest_link = w.at(0).id;
  w.at(4).rest_link = w.at(2).id;
  return s;
}

TEST(ZeroMotion, OfTheOldestFrameTakesWhatTiesItAndLeavesTheRest) {
  SyntheticWindow s = resting_window();
  const Window& w = *s.window;
  NamedBlocks oldest;
  add_zero_motion(w, {w.size() - 1, true}, &oldest);
  EXPECT_TRUE(oldest.b.count(NamedBlocks::key(velocity_biases_of(0))));
  EXPECT_FALSE(oldest.b.count(NamedBlocks::key(velocity_biases_of(3)))) << "its velocity stays in the window";
  EXPECT_TRUE(oldest.b.count(NamedBlocks::key(pose_of(3))));
  EXPECT_FALSE(oldest.b.count(NamedBlocks::key(pose_of(2))));
  // and a frame that takes no part is not reached
  NamedBlocks fewer;
  add_zero_motion(w, {3, true}, &fewer);
  EXPECT_FALSE(fewer.b.count(NamedBlocks::key(pose_of(3))));
}

TEST(ZeroMotion, ALinkToAFrameThatIsGoneTiesNothing) {
  SyntheticWindow s = resting_window();
  Window& w = *s.window;
  w.at(4).rest_link = 12345;
  NamedBlocks all;
  add_zero_motion(w, {w.size(), false}, &all);
  EXPECT_FALSE(all.b.count(NamedBlocks::key(pose_of(4))));
  EXPECT_TRUE(all.b.count(NamedBlocks::key(velocity_biases_of(4))));
}

}  // namespace
}  // namespace epiline::test
