// Where a second camera sees the first one's tracks. Tracks of its own: second_tracks_test.cc.
#include "pipeline/vision/second_tracker.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <memory>

#include "pipeline/vision/mask.h"
#include "tests/pipeline/vision/second_rig.h"

namespace epiline {
namespace {

using test::feature_of;
using test::mixed_rig;
using test::Rig;
using test::usual_rig;

/// Of the views of several images.
struct Quality {
  double share = 0, rms_px = 0, wrong_share = 0;  ///< of the visible tracks; a coordinate; more than 2 px off
};

Quality quality_of(Rig& rig, int images) {
  int visible = 0, seen = 0, wrong = 0;
  double error2 = 0;
  rig.step();
  for (int image = 0; image < images; ++image) {
    const TrackedFrame& frame = rig.step();
    Vec2 truth;
    for (const TrackedFeature& f : frame.features) visible += f.age > 0 && rig.truth(f, truth);
    for (const SecondView& view : frame.others[0].views) {
      const TrackedFeature* const f = feature_of(frame, view.id);
      if (f == nullptr || !rig.truth(*f, truth)) continue;
      const double error = (Vec2(view.pixel[0], view.pixel[1]) - truth).norm();
      ++seen;
      if (error > 2) {
        ++wrong;
      } else {
        error2 += error * error;
      }
    }
  }
  return {1. * seen / visible, std::sqrt(error2 / (2 * std::max(1, seen - wrong))), 1. * wrong / std::max(1, seen)};
}

TEST(SecondTracker, SeesTheTracksWhereTheGeometryPutsThem) {
  Rig rig(usual_rig());
  const Quality q = quality_of(rig, 10);
  EXPECT_GT(q.share, 0.9);
  EXPECT_LT(q.rms_px, 0.2);
  EXPECT_LT(q.wrong_share, 0.01);
  const SecondStats& s = rig.second.stats();
  EXPECT_EQ(s.images, 11u);
  EXPECT_GT(s.followed, 3 * s.matched) << "most views come from the second image before";
}

/// Nothing triggers them together: 20 ms later the rig has moved by 1 cm, a tenth of the baseline, and turned by 2 px.
TEST(SecondTracker, SeesThemAlsoAtAnotherTime) {
  for (const double later_s : {-0.02, 0.02}) {
    Rig rig(usual_rig());
    rig.later_s = later_s;
    rig.turn *= 6;
    const Quality q = quality_of(rig, 10);
    EXPECT_GT(q.share, 0.9);
    EXPECT_LT(q.rms_px, 0.2);
    EXPECT_LT(q.wrong_share, 0.01);
    for (const SecondView& view : rig.out->others[0].views) EXPECT_EQ(view.row_s, static_cast<float>(later_s));
    for (const TrackedFeature& track : rig.out->others[0].alone) EXPECT_EQ(track.row_s, static_cast<float>(later_s));
  }
}

/// 0.7 m/s across the baseline are 14 mm in 20 ms, which put a point at 1.6 m 1.75 px off its epipolar plane.
TEST(SecondTracker, AVelocityMayBeALittleWrong) {
  Rig rig(usual_rig());
  rig.later_s = 0.02;
  rig.velocity_error = Vec3(0, 0.7, 0);
  EXPECT_GT(quality_of(rig, 6).share, 0.9);
  EXPECT_LT(rig.second.stats().off_plane, rig.second.stats().followed / 50);
  rig.velocity_error = Vec3(0, 3, 0);
  EXPECT_LT(quality_of(rig, 6).share, 0.5);
}

TEST(SecondTracker, CamerasMayDiffer) {
  Rig rig(mixed_rig());
  const Quality q = quality_of(rig, 6);
  EXPECT_GT(q.share, 0.5) << "patches of another scale look alike less often";
  EXPECT_LT(q.rms_px, 0.3);
  EXPECT_LT(q.wrong_share, 0.01);
}

TEST(SecondTracker, BearingsAndJacobiansAreTheSecondCameras) {
  Rig rig(mixed_rig());
  EXPECT_EQ(rig.step().others[0].views.size(), 0u) << "a view must be found again before it counts";
  for (const SecondView& view : rig.step().others[0].views) {
    Vec3 f;
    Mat23 J;
    ASSERT_TRUE(rig.second_camera().bearing(Vec2(view.pixel[0], view.pixel[1]), f, J));
    EXPECT_LT((f - Vec3(view.bearing.data())).norm(), 1e-12);
    EXPECT_LT((J - Eigen::Map<const Eigen::Matrix<double, 2, 3, Eigen::RowMajor>>(view.pixel_jacobian.data())).norm(),
              1e-9);
  }
}

// A rig that is not the real one: three degrees across the baseline, or left and right exchanged.
TEST(SecondTracker, RefusesWhatTheRigDoesNotAllow) {
  SecondRig turned = usual_rig(), bent = usual_rig(), exchanged = usual_rig();
  turned.R_SC = Eigen::AngleAxisd(0.05, Vec3::UnitX()).toRotationMatrix() * turned.R_SC;
  bent.R_SC = Eigen::AngleAxisd(0.014, Vec3::UnitX()).toRotationMatrix() * bent.R_SC;  // 2.8 px
  exchanged.p_SC = -exchanged.p_SC;
  std::uint64_t off_plane = 0;
  for (const SecondRig& believed : {turned, bent, exchanged}) {
    Rig rig(usual_rig(), believed);
    for (int image = 0; image < 5; ++image) rig.step();
    const SecondStats& s = rig.second.stats();
    EXPECT_LT(static_cast<double>(s.views), 0.02 * static_cast<double>(s.tracks));
    off_plane += s.off_plane;
  }
  EXPECT_GT(off_plane, 50u);
}

TEST(SecondTracker, ACoveredLensGivesNoViews) {
  Rig rig(usual_rig());
  rig.step();
  const std::size_t before = rig.step().others[0].views.size();
  EXPECT_GT(before, 50u);
  for (int image = 0; image < 3; ++image) EXPECT_EQ(rig.step(Rig::Second::kCovered).others[0].views.size(), 0u);
  std::size_t after = 0;
  for (int image = 0; image < 9; ++image) after = rig.step().others[0].views.size();
  EXPECT_GT(after, 0.8 * static_cast<double>(before));
}

TEST(SecondTracker, HasNeitherViewsNorTracksWhereItsMaskIsBlack) {
  constexpr float kLeastX = 120 + 8 - 0.5f;  // half a patch beside the vehicle
  TestImage picture(320, 240);
  picture.fill([](int x, int) { return x < 120 ? 0 : 255; });
  TrackerConfig config;
  config.masks[1] = std::make_shared<const Mask>(picture.view());
  Rig free(usual_rig()), masked(usual_rig(), usual_rig(), config);
  std::size_t seen_there = 0, seen = 0;
  const auto is_there = [](const auto& f) { return f.pixel[0] < kLeastX; };
  for (int image = 0; image < 10; ++image) {
    for (const SecondView& v : free.step().others[0].views) seen_there += is_there(v);
    const OtherTracks& out = masked.step().others[0];
    EXPECT_TRUE(std::none_of(out.views.begin(), out.views.end(), is_there));
    EXPECT_TRUE(std::none_of(out.alone.begin(), out.alone.end(), is_there));
    seen = out.views.size();
  }
  EXPECT_GT(seen_there, 50u);
  EXPECT_GT(seen, 30u);
}

// The chain of a view ends where an image is missing: the next one is a new match.
TEST(SecondTracker, AMissingImageEndsAllViews) {
  Rig rig(usual_rig());
  rig.step();
  const std::size_t before = rig.step().others[0].views.size();
  EXPECT_EQ(rig.step(Rig::Second::kMissing).others[0].views.size(), 0u);
  EXPECT_EQ(rig.second.stats().images_missing, 1u);
  const std::uint64_t matched = rig.second.stats().matched, followed = rig.second.stats().followed;
  EXPECT_EQ(rig.step().others[0].views.size(), 0u);
  EXPECT_EQ(rig.second.stats().followed, followed);
  EXPECT_GT(rig.second.stats().matched, matched + 50);
  const TrackedFrame& again = rig.step();
  EXPECT_GT(again.others[0].views.size(), 0.8 * static_cast<double>(before));
  for (const SecondView& view : again.others[0].views)
    EXPECT_EQ(view.found, view.age - 1) << "found in the image before";
}

}  // namespace
}  // namespace epiline
