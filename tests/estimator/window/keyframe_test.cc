// Which frames are kept: parallax, not rotation, and lost overlap.
#include "estimator/window/keyframe.h"

#include <gtest/gtest.h>

#include <memory>

#include "estimator/geometry/so3.h"

namespace epiline::test {
namespace {

struct Pose {
  Vec3 p = Vec3::Zero();
  Vec3 turn = Vec3::Zero();
  int first_point = 0;  ///< sees the points first_point .. first_point + points - 1
  int points = 60;
  int own = 0;  ///< points of the vehicle, beside those
};

/// A window of frames that look along x at points 4 m ahead, the camera sitting in the body as on a robot.
std::unique_ptr<Window> window_of(std::initializer_list<Pose> poses) {
  auto w = std::make_unique<Window>(8);
  w->calibration.R_BC << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  for (const Pose& pose : poses) {
    Slot& s = w->append();
    s.x.p = pose.p;
    s.x.R = so3_exp(pose.turn);
    TrackedFrame frame;
    for (int i = pose.first_point; i < pose.first_point + pose.points + pose.own; ++i) {
      const bool own = i >= pose.first_point + pose.points;
      const int n = own ? i - pose.first_point - pose.points : i;
      const Vec3 P(4, 0.1 * (n % 8) - 0.4, 0.1 * (n / 8 % 8) - 0.4);
      const Vec3 seen = own ? P : s.x.R.transpose() * (P - s.x.p);
      const Vec3 f = (w->calibration.R_BC.transpose() * seen).normalized();
      TrackedFeature feature;
      feature.id = static_cast<std::uint32_t>(own ? 1000 + n : n);
      feature.bearing = {f.x(), f.y(), f.z()};
      feature.pixel_jacobian = {458, 0, 0, 0, 458, 0};
      frame.features.push_back(feature);
    }
    w->observe(frame);
  }
  return w;
}

/// Whether the second newest frame is a keyframe.
bool is_kept(const Window& w) { return is_keyframe(w, w.size() - 3, w.size() - 2, {}); }

TEST(Keyframe, PureRotationMakesNone) {
  for (const Vec3& turn : {Vec3(0, 0, 0.1), Vec3(0.1, 0, 0), Vec3(0, -0.2, 0)}) {
    const auto w = window_of({{}, {.turn = turn}, {}});
    EXPECT_FALSE(is_kept(*w));
    EXPECT_LT(compensated_parallax_px(*w, 0, 1, 458), 458e-7);  // a bearing has seven digits
  }
}

TEST(Keyframe, WidestParallaxIsAgainstTheOldestFrameThatStillSeesTheSame) {
  const Vec3 right(0, 0.1, 0);
  const auto w = window_of({{.p = -5 * right, .first_point = 55}, {.p = right}, {.p = 2 * right}, {.p = 4 * right}});
  EXPECT_NEAR(widest_parallax_px(*w, 458), 458 * 0.3 / 4, 1) << "0.3 m at 4 m; frame 0 has 5 points in common";
  EXPECT_EQ(widest_parallax_px(*window_of({{}, {.first_point = 60}}), 458), 0);
}

TEST(Keyframe, TranslationMakesOneBeyondTenPixels) {
  // 4 m away, 458 px: 1 px is 8.7 mm across; turned on the way, it is the same parallax
  EXPECT_FALSE(is_kept(*window_of({{}, {.p = Vec3(0, 0.08, 0)}, {}})));
  EXPECT_TRUE(is_kept(*window_of({{}, {.p = Vec3(0, 0.09, 0)}, {}})));
  EXPECT_FALSE(is_kept(*window_of({{}, {.p = Vec3(0, 0.08, 0), .turn = Vec3(0, 0, 0.05)}, {}})));
  EXPECT_TRUE(is_kept(*window_of({{}, {.p = Vec3(0, 0.09, 0), .turn = Vec3(0, 0, 0.05)}, {}})));
}

TEST(Keyframe, MeasuresParallaxInPixels) {
  const auto w = window_of({{}, {.p = Vec3(0, 0.1, 0), .first_point = 20}});
  EXPECT_NEAR(compensated_parallax_px(*w, 0, 1, 458), 458 * 0.1 / 4, 0.4);  // off the axis it is less
  EXPECT_EQ(common_tracks(*w, 0, 1), 40);
  const auto apart = window_of({{}, {.first_point = 100}});
  EXPECT_EQ(compensated_parallax_px(*apart, 0, 1, 458), 0);
  EXPECT_EQ(common_tracks(*apart, 0, 1), 0);
}

/// Seen by the second newest frame and by the one before it, out of those the former sees.
TEST(Keyframe, LostOverlapMakesOne) {
  EXPECT_FALSE(is_kept(*window_of({{}, {.first_point = 30}, {}})));  // 30 of 60
  EXPECT_TRUE(is_kept(*window_of({{}, {.first_point = 31}, {}})));   // 29 of 60
}

/// Parts of the vehicle, and what is far away, stay in the image, and live longer than the scene.
TEST(Keyframe, TracksThatStayHideNeitherParallaxNorLostOverlap) {
  const Pose begin{.own = 40};
  EXPECT_TRUE(is_kept(*window_of({begin, {.p = Vec3(0, 0.09, 0), .own = 40}, {}})));
  EXPECT_TRUE(is_kept(*window_of({begin, {.p = Vec3(0, 0.05, 0), .first_point = 31, .own = 40}, {}})));
  // and they are no parallax where the camera turns
  EXPECT_FALSE(is_kept(*window_of({begin, {.turn = Vec3(0, 0, 0.1), .own = 40}, {}})));
  // while everything stays, they are tracks like others
  EXPECT_FALSE(is_kept(*window_of({begin, {.first_point = 45, .own = 40}, {}})));
}

TEST(Keyframe, FewThatMoveByThemselvesAreNoScene) {
  const Pose stands{.points = 0, .own = 100};
  Pose passed_by = stands;
  passed_by.points = 25;
  Pose later = passed_by;
  later.p = Vec3(0, 0.2, 0);
  EXPECT_FALSE(is_kept(*window_of({passed_by, later, {}})));
}

TEST(Keyframe, FewerThanTwentyCommonTracksMakeOne) {
  EXPECT_FALSE(is_kept(*window_of({{}, {.points = 20}, {}})));
  EXPECT_TRUE(is_kept(*window_of({{}, {.points = 19}, {}})));
}

TEST(Keyframe, JudgesTheSecondNewestFrame) {
  const Pose there{.p = Vec3(0, 0.2, 0)};
  EXPECT_FALSE(is_kept(*window_of({{}, {}, there})));
  EXPECT_TRUE(is_kept(*window_of({{}, there, there})));
  EXPECT_FALSE(is_kept(*window_of({{}, there, there, {}})));  // against its neighbour, not the first
  EXPECT_TRUE(is_kept(*window_of({{}})));                     // nothing to compare with
}

}  // namespace
}  // namespace epiline::test
