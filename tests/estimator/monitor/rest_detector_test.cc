// Rest as the camera sees it: how often it is missed, and that a slow drift is not taken for it. Derivation:
// docs/derivations/zero_motion.md.
#include "estimator/monitor/rest_detector.h"

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <random>

#include "tests/estimator/synthetic_window.h"

namespace epiline::test {
namespace {

struct Scene {
  int tracks = 100;
  double noise_px = 0.3;
  double sigma_px = 0.3;         ///< of a bearing, as the caller says
  double rate = 0;               ///< rad/s, what the gyroscope says
  Vec3 velocity = Vec3::Zero();  ///< m/s, of the camera, in C
  double depth = 5;
  double outliers = 0;          ///< share of the features that move by themselves, 40 px/s
  int renewed_every = 1 << 30;  ///< images after which all tracks get new ids
};

/// Share of the frames called rest, of those from 1 s on, images at 10 Hz. `drifts`: how often rest was taken back.
double share_at_rest(const Scene& s, int frames = 400, int* drifts = nullptr) {
  const auto detector = std::make_unique<RestDetector>();
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal(0, s.noise_px);
  std::uniform_real_distribution<double> u(-0.5, 0.5);
  std::vector<Vec3> points;
  for (int i = 0; i < s.tracks; ++i) points.push_back(s.depth * Vec3(u(random), u(random), 1));
  int rest = 0, judged = 0;
  for (int k = 0; k < frames; ++k) {
    const double t = 0.1 * k;
    TrackedFrame frame;
    frame.stamp = HostStamp{k * 100'000'000LL};
    for (int i = 0; i < s.tracks; ++i) {
      Vec3 X = points[static_cast<std::size_t>(i)] - s.velocity * std::fmod(t, 20);
      if (i < s.outliers * s.tracks) X.x() += s.depth * 40 / kFocal * std::fmod(t, 5);
      const int id = i + 1000 * (k / s.renewed_every);
      frame.features.push_back(make_feature(static_cast<std::uint32_t>(id), X, Vec2(normal(random), normal(random))));
    }
    const bool still =
        detector->update(frame, s.sigma_px, s.rate, {Mat3::Identity(), false}) == RestDetector::Verdict::kStands;
    if (drifts) *drifts += detector->was_drift();
    if (t < 1) continue;
    ++judged;
    rest += still;
  }
  return static_cast<double>(rest) / judged;
}

TEST(RestDetector, SeesRestAtAnyNoiseItIsToldOf) {
  // sigma has a floor of 0.3 px: better tracks than that must be no trouble
  EXPECT_EQ(share_at_rest({.noise_px = 0.03, .sigma_px = 0.3}), 1);
  EXPECT_GT(share_at_rest({.noise_px = 0.3, .sigma_px = 0.3}), 0.98);
  EXPECT_GT(share_at_rest({.noise_px = 1, .sigma_px = 1}), 0.98);
  // residuals of tracks that may drift show five sixths of white noise
  EXPECT_GT(share_at_rest({.noise_px = 1, .sigma_px = 0.84}), 0.9);
}

/// The tests of displacement (3.5 sigma) and spread (7.8 for 4) are statistics: flicker. Few tracks make the spread
/// uncertain.
TEST(RestDetector, MissesRestRarelyAndNotMuchMoreOftenWithFewTracks) {
  EXPECT_GT(share_at_rest({.tracks = 200}, 2000), 0.99);
  EXPECT_GT(share_at_rest({.tracks = 50}, 2000), 0.95);
  EXPECT_GT(share_at_rest({.tracks = 25}, 2000), 0.85);
}

TEST(RestDetector, IsNotFooledByADriftOfACentimetrePerSecondAtFiveMetres) {
  EXPECT_EQ(share_at_rest({.velocity = Vec3(0.01, 0, 0)}), 0);
  EXPECT_EQ(share_at_rest({.noise_px = 0.03, .velocity = Vec3(0, 0.01, 0)}), 0);
  EXPECT_LT(share_at_rest({.tracks = 150, .noise_px = 1, .sigma_px = 1, .velocity = Vec3(0.01, 0, 0)}), 0.3);
  EXPECT_EQ(share_at_rest({.velocity = Vec3(0, 0, 0.1)}), 0);  // ahead: the mean stays, the spread grows
}

/// Below what half a second shows: the bearings of the moment when rest began show it, and it is not believed again.
TEST(RestDetector, FindsASlowDriftOutAndDoesNotBelieveItAgain) {
  for (const Vec3& velocity : {Vec3(0.003, 0, 0), Vec3(0, -0.002, 0), Vec3(0, 0, 0.004)}) {
    int drifts = 0;
    const double share = share_at_rest({.velocity = velocity}, 190, &drifts);  // the camera jumps back every 20 s
    EXPECT_LT(share, 0.3) << velocity.transpose();
    EXPECT_GE(drifts, 1) << velocity.transpose();
    EXPECT_LE(drifts, 2) << velocity.transpose();
  }
}

TEST(RestDetector, TakesNothingBackWhileNothingMoves) {
  int drifts = 0;
  EXPECT_GT(share_at_rest({.noise_px = 0.3}, 3000, &drifts), 0.99);
  EXPECT_EQ(drifts, 0);
}

/// A body that moved plainly has nothing to do with the drift before.
TEST(RestDetector, BelievesInRestSoonAfterPlainMotion) {
  const auto detector = std::make_unique<RestDetector>();
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal(0, 0.3);
  const auto where = [](double t) {  // a slow drift, a jerk, rest
    if (t < 15) return 0.003 * t;
    return t < 16 ? 0.045 + 0.5 * (t - 15) : 0.545;
  };
  int taken_back = 0;
  double rest_since = -1;
  for (int k = 0; k < 200; ++k) {
    const double t = 0.1 * k;
    TrackedFrame frame;
    frame.stamp = HostStamp{k * 100'000'000LL};
    for (int i = 0; i < 100; ++i) {
      const Vec3 X(0.3 * (i % 10) - 1.5 - where(t), 0.3 * (i / 10) - 1.5, 5);
      frame.features.push_back(make_feature(static_cast<std::uint32_t>(i), X, Vec2(normal(random), normal(random))));
    }
    const bool rests = detector->update(frame, 0.3, 0, {Mat3::Identity(), false}) == RestDetector::Verdict::kStands;
    taken_back += detector->was_drift();
    if (t > 10 && t < 15) {
      EXPECT_FALSE(rests) << t;
    }
    if (t > 16 && rests && rest_since < 0) rest_since = t;
  }
  EXPECT_GE(taken_back, 1);
  EXPECT_GT(rest_since, 16);
  EXPECT_LT(rest_since, 17.2);
}

/// Image k of a wall, by a camera that turns in its place.
TrackedFrame turned_view(int k, const Mat3& R_WC, std::mt19937_64& random) {
  std::normal_distribution<double> normal(0, 0.1);
  TrackedFrame frame;
  frame.stamp = HostStamp{k * 100'000'000LL};
  for (int i = 0; i < 100; ++i) {
    const Vec3 X(0.3 * (i % 10) - 1.5, 0.3 * (i / 10) - 1.5, 5);
    frame.features.push_back(
        make_feature(static_cast<std::uint32_t>(i), R_WC.transpose() * X, Vec2(normal(random), normal(random))));
  }
  return frame;
}

/// A drone whose motors stop stands in another attitude than the one it was set down in.
TEST(RestDetector, AVehicleThatSettlesAfterShakingHasNotDrifted) {
  const auto detector = std::make_unique<RestDetector>();
  std::mt19937_64 random(7);
  int rests = 0, taken_back = 0;
  for (int k = 0; k < 100; ++k) {
    const bool shakes = k > 10 && k < 40;
    const double turn = k <= 10 ? 0 : shakes ? 0.0004 + 0.0003 * std::sin(2.1 * k) : 0.0007;  // rad
    const Mat3 R_WC = so3_exp(Vec3(turn, 0, 0));
    const TrackedFrame frame = turned_view(k, R_WC, random);
    const bool stands = detector->update(frame, 0.3, 0, {R_WC, shakes}) == RestDetector::Verdict::kStands;
    taken_back += detector->was_drift();
    rests += k >= 50 && stands;
  }
  EXPECT_EQ(taken_back, 0);
  EXPECT_GE(rests, 49);  // of 50
}

/// It has rocked by a pixel, which the estimated attitudes do not follow.
TEST(RestDetector, AVehicleThatIsShakenStandsWhereItIsSaidTo) {
  for (const bool said : {false, true}) {
    const auto detector = std::make_unique<RestDetector>();
    std::mt19937_64 random(7);
    int moves = 0;
    for (int k = 0; k < 10; ++k) {
      const Mat3 R_WC = so3_exp(Vec3(k < 4 ? 0.001 : -0.001, 0, 0));
      const TrackedFrame frame = turned_view(k, R_WC, random);
      const RestDetector::Verdict verdict = detector->update(frame, 0.3, 0, {Mat3::Identity(), true});
      if (k == 3 && said) detector->assume_rest(Mat3::Identity());
      moves += k > 3 && verdict == RestDetector::Verdict::kMoves;
    }
    EXPECT_EQ(moves, said ? 0 : 6);
  }
}

TEST(RestDetector, WantsTheGyroscopeToAgree) {
  EXPECT_GT(share_at_rest({.rate = 0.015}), 0.98);
  EXPECT_EQ(share_at_rest({.rate = 0.025}), 0);
}

// The first image after a turn of 0.02 rad, about any axis, shows it without the gyroscope.
TEST(RestDetector, SeesATurnWithoutTheGyroscope) {
  constexpr double kImage_s = 0.1, kFrom_s = 3;
  for (const double rate : {0.2, 0.5, 2.})
    for (const double noise_px : {0.3, 1.})
      for (const Vec3& axis : {Vec3(Vec3::UnitX()), Vec3(Vec3::UnitY()), Vec3(Vec3::UnitZ())}) {
        const auto detector = std::make_unique<RestDetector>();
        std::mt19937_64 random(3);
        std::normal_distribution<double> normal(0, noise_px);
        std::uniform_real_distribution<double> u(-0.5, 0.5);
        std::vector<Vec3> points;
        for (int i = 0; i < 120; ++i) points.push_back(Vec3(u(random), u(random), 1));
        int rests = 0;
        double turned = 0;
        for (int k = 0; k * kImage_s < kFrom_s + 2; ++k) {
          const double angle = rate * std::max(0., k * kImage_s - kFrom_s);
          TrackedFrame frame;
          frame.stamp = HostStamp{k * 100'000'000LL};
          for (std::size_t i = 0; i < points.size(); ++i)
            frame.features.push_back(make_feature(static_cast<std::uint32_t>(i), so3_exp(-angle * axis) * points[i],
                                                  Vec2(normal(random), normal(random))));
          if (detector->update(frame, noise_px, 0, {Mat3::Identity(), false}) != RestDetector::Verdict::kStands)
            continue;
          ++rests;
          turned = angle;
        }
        EXPECT_GT(rests, 20) << rate << ' ' << noise_px;
        EXPECT_EQ(turned, 0) << rate << ' ' << noise_px << ' ' << axis.transpose();
      }
}

/// Images of `own` parts of the vehicle, fixed, before a wall 5 m away; by a camera that has moved to `moved`, and
/// turned.
class WallInView {
 public:
  explicit WallInView(int own) : own_(own) {}
  RestDetector::Verdict see(const Vec3& moved, const Vec3& turned, double rate) {
    TrackedFrame frame;
    frame.stamp = HostStamp{k_++ * 100'000'000LL};
    for (int i = 0; i < 100; ++i) {
      const Vec3 X(0.5 * (i % 10) - 2.25, 0.3 * (i / 10) - 1.35, 5);
      add(frame, i, i >= 100 - own_ ? X : Vec3(so3_exp(-turned) * (X - moved)));
    }
    return detector_->update(frame, 0.3, rate, {Mat3::Identity(), false});
  }
  /// A lorry 5 m away hides all but every third, and has moved so far since it came.
  RestDetector::Verdict see_lorry(double moved_m) {
    TrackedFrame frame;
    frame.stamp = HostStamp{k_++ * 100'000'000LL};
    for (int i = 0; i < 100; ++i) {
      const Vec3 X(0.5 * (i % 10) - 2.25, 0.3 * (i / 10) - 1.35, 5);
      add(frame, i % 3 == 0 ? i : 1000 + i, i % 3 == 0 ? X : Vec3(X + Vec3(moved_m, 0, 0)));
    }
    return detector_->update(frame, 0.3, 0, {Mat3::Identity(), false});
  }

 private:
  void add(TrackedFrame& frame, int id, const Vec3& X) {
    frame.features.push_back(make_feature(static_cast<std::uint32_t>(id), X, Vec2(normal_(random_), normal_(random_))));
  }
  std::unique_ptr<RestDetector> detector_ = std::make_unique<RestDetector>();
  std::mt19937_64 random_{3};
  std::normal_distribution<double> normal_{0, 0.3};
  int own_, k_ = 0;
};

constexpr auto kStands = RestDetector::Verdict::kStands;

// A third of the view is enough to see that what stood still stands; it is not enough to find that out.
TEST(RestDetector, StandsWhileALorryFillsTheView) {
  for (const bool stood : {true, false}) {
    WallInView scene(0);
    int rests = 0;
    for (int k = 0; k < 20 && stood; ++k) rests += scene.see(Vec3::Zero(), Vec3::Zero(), 0) == kStands;
    EXPECT_EQ(rests, stood ? 16 : 0);
    for (int k = 0; k < 50; ++k) rests += scene.see_lorry(0.4 * k) == kStands;
    EXPECT_EQ(rests, stood ? 66 : 0);
  }
}

TEST(RestDetector, OwnPartsHoldNothingThatLeaves) {
  for (const double acceleration : {0.02, 0.1, 0.5, 2.}) {
    WallInView scene(40);
    int rests = 0;
    for (int k = 0; k < 70; ++k) {
      const double t = std::max(0., 0.1 * k - 2);
      const bool stands = scene.see(Vec3(0.5 * acceleration * t * t, 0, 0), Vec3::Zero(), 0) == kStands;
      EXPECT_TRUE(stands || k != 20) << acceleration;
      rests += stands && 0.5 * acceleration * t * t > 0.02;
    }
    EXPECT_EQ(rests, 0) << acceleration;
  }
}

TEST(RestDetector, OwnPartsHoldNothingThatTurns) {
  for (const double rate : {0.03, 0.3, 3.}) {
    WallInView scene(40);
    int rests = 0;
    for (int k = 0; k < 40; ++k) {
      const double t = std::max(0., 0.1 * k - 2);
      rests += scene.see(Vec3::Zero(), Vec3(0, rate * t, 0), t > 0 ? rate : 0) == kStands && t > 0;
    }
    EXPECT_EQ(rests, 0) << rate;
  }
}

// After a blow a gyroscope reads nonsense: the first image would have shown it.
TEST(RestDetector, ATurnThatTheWholeViewDoesNotShowIsNone) {
  WallInView scene(0);
  for (int k = 0; k < 40; ++k) {
    const auto verdict = scene.see(Vec3::Zero(), Vec3::Zero(), k == 20 ? 2 : 0);
    EXPECT_TRUE(verdict == kStands || k < 10) << k;
  }
}

TEST(RestDetector, OverlooksThingsThatMoveByThemselves) { EXPECT_GT(share_at_rest({.outliers = 0.2}), 0.9); }

TEST(RestDetector, SaysNothingWithoutTwentyCommonTracksOrAnOldImage) {
  EXPECT_EQ(share_at_rest({.tracks = 19}), 0);
  EXPECT_GT(share_at_rest({.tracks = 100, .renewed_every = 10}), 0.2);  // some images have one of the same tracks
  EXPECT_EQ(share_at_rest({.tracks = 100, .renewed_every = 4}), 0);     // none 0.35 s old has
  EXPECT_EQ(share_at_rest({.tracks = 0}), 0);
}

TEST(RestDetector, ForgetsWhenCleared) {
  const auto detector = std::make_unique<RestDetector>();
  TrackedFrame frame;
  for (int i = 0; i < 50; ++i)
    frame.features.push_back(make_feature(static_cast<std::uint32_t>(i), Vec3(0.01 * i, 0, 1), Vec2::Zero()));
  bool still = false;
  auto until = [&](int from, int to) {
    for (int k = from; k < to; ++k) {
      frame.stamp = HostStamp{k * 100'000'000LL};
      still = detector->update(frame, 0.3, 0, {Mat3::Identity(), false}) == RestDetector::Verdict::kStands;
    }
  };
  until(0, 4);
  EXPECT_FALSE(still);  // 0.3 s are not enough
  until(4, 5);
  EXPECT_TRUE(still && detector->images_still());
  detector->clear();
  EXPECT_FALSE(detector->images_still());
  until(5, 9);
  EXPECT_FALSE(still);
  until(9, 10);
  EXPECT_TRUE(still);
  until(30, 31);
  EXPECT_FALSE(still);  // the last image is two seconds old
}

}  // namespace
}  // namespace epiline::test
