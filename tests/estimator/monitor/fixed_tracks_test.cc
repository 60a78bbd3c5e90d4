// Tracks of the vehicle's own parts are found, and nothing else. Derivation:
// docs/derivations/zero_motion.md#tracks-that-stay.
#include "estimator/monitor/fixed_tracks.h"

#include <gtest/gtest.h>

#include <memory>
#include <random>

#include "tests/estimator/synthetic_window.h"

namespace epiline::test {
namespace {

/// 100 tracks, of which the first `stay` ones do; the others move by `px_s`. Images at 10 Hz.
class View {
 public:
  explicit View(int stay) : stay_(stay) {}
  void run(double seconds, double px_s, bool moves) {
    for (int k = 0; k < static_cast<int>(10 * seconds); ++k) {
      moved_px_ += 0.1 * px_s;
      TrackedFrame frame;
      frame.stamp = HostStamp{++image_ * 100'000'000LL};
      for (int i = 0; i < 100; ++i) {
        const Vec3 X(0.01 * i - 0.5 + (i < stay_ ? 0 : moved_px_ / kFocal), 0, 1);
        frame.features.push_back(
            make_feature(static_cast<std::uint32_t>(99 - i), X, 0.3 * Vec2(normal_(random_), normal_(random_))));
      }
      fixed_->update(frame, 0.3, moves);
    }
  }
  int found(int from, int to) const {
    int n = 0;
    for (int i = from; i < to; ++i) n += fixed_->contains(static_cast<std::uint32_t>(99 - i));
    return n;
  }
  bool none() const { return fixed_->empty(); }

 private:
  int stay_, image_ = 0;
  double moved_px_ = 0;
  std::unique_ptr<FixedTracks> fixed_ = std::make_unique<FixedTracks>();
  std::mt19937_64 random_{5};
  std::normal_distribution<double> normal_;
};

TEST(FixedTracks, AreFoundWhileOthersMoveAndLastThroughARest) {
  for (const int stay : {10, 60}) {
    View view(stay);
    view.run(3, 0, false);
    view.run(2, 20, true);
    EXPECT_GT(view.found(0, stay), 0.8 * stay);
    EXPECT_EQ(view.found(stay, 100), 0);
    view.run(3, 0, false);
    EXPECT_GT(view.found(0, stay), 0.5 * stay);
    EXPECT_EQ(view.found(stay, 100), 0);
  }
}

// A vehicle that stands is passed by others, and one that stops stops all tracks at once.
TEST(FixedTracks, AreNoneAtRest) {
  View view(40);
  view.run(5, 50, false);
  EXPECT_TRUE(view.none());
  View stops(0);
  stops.run(2, 20, true);
  stops.run(3, 0, true);
  EXPECT_TRUE(stops.none());
}

TEST(FixedTracks, AreNoneBesideFewThatMoveByThemselves) {
  View view(85);
  view.run(5, 50, true);
  EXPECT_TRUE(view.none());
}

}  // namespace
}  // namespace epiline::test
