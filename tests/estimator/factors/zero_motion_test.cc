// The factor of standing still: slope of its cost, which frames it ties, and what of it goes with the oldest frame.
// Derivation: docs/derivations/zero_motion.md.
#include "estimator/factors/zero_motion.h"

#include <gtest/gtest.h>

#include <map>
#include <vector>

#include "tests/estimator/synthetic_window.h"

namespace epiline {
namespace {

/// Keeps every block apart, by the names of its unknowns.
class Blocks final : public NormalEquations {
 public:
  Block block(Unknown row, Unknown column) noexcept override {
    auto& M = H[{key(row), key(column)}];
    return {M.data(), 9, 1};
  }
  double* rhs(Unknown a) noexcept override { return b[key(a)].data(); }
  static int key(Unknown a) { return 100 * static_cast<int>(a.kind) + a.frame; }

  std::map<std::pair<int, int>, std::array<double, 81>> H;
  std::map<int, std::array<double, 9>> b;
};

SyntheticWindow resting_window() {
  SyntheticWindow s = make_window({.frames = 5});
  Window& w = *s.window;
  for (const int k : {0, 3, 4}) w.at(k).at_rest = true;
  w.at(3).rest_link = w.at(0).id;
  w.at(4).rest_link = w.at(2).id;
  return s;
}

TEST(ZeroMotion, SlopeIsThatOfItsCost) {
  SyntheticWindow s = resting_window();
  Window& w = *s.window;
  const Share all{w.size(), false};
  Blocks at;
  EXPECT_EQ(add_zero_motion(w, all, &at), add_zero_motion(w, all, nullptr));
  constexpr double h = 1e-4;  // the cost is quadratic
  for (int k = 0; k < w.size(); ++k)
    for (int i = 0; i < 6; ++i) {
      double& x = i < 3 ? w.at(k).x.p[i] : w.at(k).x.v[i - 3];
      const double keep = x;
      x = keep + h;
      const double plus = add_zero_motion(w, all, nullptr);
      x = keep - h;
      const double minus = add_zero_motion(w, all, nullptr);
      x = keep;
      const Unknown unknown = i < 3 ? pose_of(k) : velocity_biases_of(k);
      const auto found = at.b.find(Blocks::key(unknown));
      const double b = found == at.b.end() ? 0 : found->second[static_cast<std::size_t>(i % 3)];
      EXPECT_NEAR(b, -0.25 * (plus - minus) / h, 1e-6 * (1 + std::abs(b))) << "frame " << k << ", " << i;
    }
}

TEST(ZeroMotion, OfTheOldestFrameTakesWhatTiesItAndLeavesTheRest) {
  SyntheticWindow s = resting_window();
  const Window& w = *s.window;
  Blocks oldest;
  add_zero_motion(w, {w.size() - 1, true}, &oldest);
  EXPECT_TRUE(oldest.b.count(Blocks::key(velocity_biases_of(0))));
  EXPECT_FALSE(oldest.b.count(Blocks::key(velocity_biases_of(3)))) << "its velocity stays in the window";
  EXPECT_TRUE(oldest.b.count(Blocks::key(pose_of(3))));
  EXPECT_FALSE(oldest.b.count(Blocks::key(pose_of(2))));
  // and a frame that takes no part is not reached
  Blocks fewer;
  add_zero_motion(w, {3, true}, &fewer);
  EXPECT_FALSE(fewer.b.count(Blocks::key(pose_of(3))));
}

TEST(ZeroMotion, ALinkToAFrameThatIsGoneTiesNothing) {
  SyntheticWindow s = resting_window();
  Window& w = *s.window;
  w.at(4).rest_link = 12345;
  Blocks all;
  add_zero_motion(w, {w.size(), false}, &all);
  EXPECT_FALSE(all.b.count(Blocks::key(pose_of(4))));
  EXPECT_TRUE(all.b.count(Blocks::key(velocity_biases_of(4))));
}

}  // namespace
}  // namespace epiline
