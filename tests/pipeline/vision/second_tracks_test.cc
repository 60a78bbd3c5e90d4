// What a second camera tracks by itself, and beside which camera others look.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <vector>

#include "pipeline/stages/front_end.h"
#include "tests/pipeline/vision/second_rig.h"

namespace epiline {
namespace {

using test::first_lens;
using test::picture;
using test::Pose;
using test::Rig;
using test::usual_rig;
using test::Wedge;

/// Tracks of this image that live since `age` images at least.
std::size_t older_than(const TrackedFrame& frame, std::uint32_t age) {
  return static_cast<std::size_t>(std::count_if(frame.others[0].alone.begin(), frame.others[0].alone.end(),
                                                [&](const TrackedFeature& f) { return f.age > age; }));
}

TEST(SecondTracker, HasAFewTracksOfItsOwnBesideTheFirstCameras) {
  Rig rig(usual_rig());
  for (int image = 0; image < 6; ++image) {
    const TrackedFrame& frame = rig.step();
    EXPECT_LE(frame.others[0].alone.size(), 15u);
    for (const TrackedFeature& own : frame.others[0].alone) {
      if (own.age > 0) continue;
      for (const SecondView& view : frame.others[0].views)
        EXPECT_GE(std::hypot(own.pixel[0] - view.pixel[0], own.pixel[1] - view.pixel[1]), 20) << "seen already";
    }
  }
  EXPECT_GT(older_than(*rig.out, 2), 2u) << "the views of the first camera's tracks leave little room in this image";
  EXPECT_GE(rig.second.stats().alone, rig.out->others[0].alone.size());
}

TEST(SecondTracker, CarriesOnWhileTheFirstCameraShowsNothing) {
  Rig rig(usual_rig());
  for (int image = 0; image < 4; ++image) rig.step();
  const std::size_t before = rig.out->others[0].alone.size();
  for (int image = 0; image < 4; ++image) {
    const TrackedFrame& frame = rig.step(Rig::Second::kSeen, false);
    EXPECT_EQ(frame.others[0].views.size(), 0u);
    EXPECT_GT(older_than(frame, static_cast<std::uint32_t>(image)), before / 2) << "they live on";
  }
  EXPECT_GT(rig.out->others[0].alone.size(), 2 * before) << "the first camera's place is taken";
  for (int image = 0; image < 3; ++image) rig.step();
  EXPECT_GT(rig.out->others[0].views.size(), 30u) << "both see again";
  for (const TrackedFeature& own : rig.out->others[0].alone)
    for (const SecondView& view : rig.out->others[0].views)
      EXPECT_GE(std::hypot(own.pixel[0] - view.pixel[0], own.pixel[1] - view.pixel[1]), 2.9) << "one corner, one track";
}

TEST(SecondTracker, WithoutTracksOfItsOwnThereAreNoneEver) {
  TrackerConfig config;
  config.second_features = 0;
  Rig rig(usual_rig(), usual_rig(), config);
  for (const bool first : {true, true, false, false, true})
    EXPECT_EQ(rig.step(Rig::Second::kSeen, first).others[0].alone.size(), 0u);
}

/// The second camera of a rig whose first one sits there.
OtherLens mounted(const SecondRig& rig, const CameraMount& first) {
  const Mat3 R_BS = first.R_BC * rig.R_SC.transpose();
  return {rig.camera, {R_BS, first.p_BC - R_BS * rig.p_SC}};
}

// One camera's tracks do not depend on a second one.
TEST(SecondTracker, LeavesTheFirstCamerasTracksAsTheyAre) {
  const SecondRig rig = usual_rig();
  const Camera camera(first_lens());
  const Wedge wedge;
  FrontEnd one(camera, {}, {}), two(camera, {}, {}, {mounted(rig, {})});
  const auto a = std::make_unique<TrackedFrame>(), b = std::make_unique<TrackedFrame>();
  std::vector<TestImage> images;
  for (int k = 0; k < 3; ++k) images.push_back(picture(camera, {Mat3::Identity(), Vec3(0.02 * k, 0, 0)}, wedge));
  for (int k = 0; k < 3; ++k) {
    one.step(frame_of(images[k], k + 1), {}, *a);
    two.step(frame_of(images[k], k + 1), {frame_of(images[2 - k], k + 1)}, *b);
    ASSERT_EQ(a->features.size(), b->features.size());
    EXPECT_EQ(a->others[0].views.size(), 0u);
    for (std::size_t i = 0; i < a->features.size(); ++i) {
      EXPECT_EQ(a->features[i].id, b->features[i].id);
      EXPECT_EQ(a->features[i].pixel, b->features[i].pixel);
    }
  }
}

/// Of four cameras two are upside down, so that their images are like each other's and not like those of the first two.
TEST(SecondTracker, EachCameraLooksForTheTracksOfOneBeforeIt) {
  const Camera camera(first_lens());
  const Wedge wedge;
  const Mat3 over = Eigen::AngleAxisd(3.14159265, Vec3::UnitZ()).toRotationMatrix();
  const CameraMount third{over, Vec3(0.05, 0.05, 0)};
  const OtherLenses others = {mounted(usual_rig(), {}), OtherLens{first_lens(), third}, mounted(usual_rig(), third)};
  FrontEnd all(camera, {}, {}, others);
  const auto out = std::make_unique<TrackedFrame>();
  std::vector<TestImage> images;
  const auto step = [&](int number, const std::array<bool, 4>& shows) {
    const std::size_t from = images.size();
    for (std::size_t c = 0; c < 4; ++c) {
      const OtherLens lens = c == 0 ? OtherLens{first_lens(), {}} : *others[c - 1];
      const Pose pose{lens.mount.R_BC, Vec3(0.02 * number, 0.01 * number, 0) + lens.mount.p_BC};
      images.push_back(picture(Camera(lens.camera), pose, wedge));
    }
    Frame frames[4];
    for (std::size_t c = 0; c < 4; ++c)
      if (shows[c]) frames[c] = frame_of(images[from + c], number + 1);
    if (!shows[0]) {
      frames[0] = frame_of(images[from], number + 1);
      frames[0].reasons = static_cast<std::uint32_t>(HealthReason::kLensCovered);
    }
    all.step(frames[0], {frames[1], frames[2], frames[3]}, *out);
  };
  images.reserve(64);
  for (int k = 0; k < 4; ++k) step(k, {true, true, true, true});
  const auto views = [&](std::size_t camera_number) { return out->others[camera_number - 1].views.size(); };
  const auto alone = [&](std::size_t camera_number) { return out->others[camera_number - 1].alone.size(); };
  EXPECT_GT(views(1), 50u);
  EXPECT_EQ(views(2), 0u) << "nothing looks like it";
  EXPECT_GT(alone(2), 60u) << "so it has as many tracks of its own as the first one";
  EXPECT_GT(views(3), 50u);
  for (std::size_t c = 1; c <= 3; ++c)
    for (const TrackedFeature& f : out->others[c - 1].alone) EXPECT_EQ(f.id >> 30, c);
  for (const SecondView& v : out->others[2].views) EXPECT_EQ(v.id >> 30, 2u) << "of the third camera's tracks";

  step(4, {true, true, false, true});
  EXPECT_EQ(alone(2), 0u);
  EXPECT_EQ(views(3), 0u) << "the camera beside which it is shows nothing";
  EXPECT_GT(alone(3), 60u) << "its own tracks take their place";
  EXPECT_GT(views(1), 50u);
  step(5, {false, true, true, true});
  EXPECT_EQ(out->features.size(), 0u);
  EXPECT_EQ(views(1), 0u);
  EXPECT_GT(alone(1), 60u);
}

/// Cameras that look elsewhere, from the same place, or with lenses that differ too much have nothing in common.
TEST(SecondTracker, CamerasWithoutCommonTracksHaveTheirOwn) {
  TrackerConfig none_alone;
  none_alone.second_features = 0;
  const auto check = [&](auto&& change) {
    SecondRig rig = usual_rig();
    change(rig);
    EXPECT_THROW(SecondTracker(Camera(first_lens()), rig, none_alone), std::invalid_argument);
    Rig flight(rig);
    flight.step();
    EXPECT_EQ(flight.step().others[0].views.size(), 0u);
    EXPECT_GT(flight.out->others[0].alone.size(), 60u);
  };
  check([](SecondRig& rig) { rig.p_SC.setZero(); });
  check([](SecondRig& rig) { rig.R_SC = Eigen::AngleAxisd(3.1, Vec3::UnitZ()).toRotationMatrix(); });
  check([](SecondRig& rig) { rig.camera.intrinsics = {100, 100, 158, 121}; });
}

TEST(SecondTracker, RefusesARigThatItCannotUse) {
  SecondRig tiny = usual_rig();
  tiny.camera.width = 50;
  EXPECT_THROW(SecondTracker(Camera(first_lens()), tiny, {}), std::invalid_argument);
}

}  // namespace
}  // namespace epiline
