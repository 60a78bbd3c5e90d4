#include "pipeline/vision/second_tracker.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <stdexcept>
#include <vector>

#include "pipeline/stages/front_end.h"
#include "pipeline/vision/mask.h"
#include "pipeline/vision/tracker.h"
#include "platform/memory/allocation_count.h"
#include "tests/pipeline/vision/support.h"

namespace epiline {
namespace {

constexpr double kNearest_m = 1.6, kSlope = 0.5;  // of the edge towards the cameras; of the walls beside it

/// Two walls that meet in an edge towards the cameras: z = 1.6 + 0.5 |x|. World axes are those of the first camera.
class Wedge {
 public:
  /// The first point of the ray that lies on a wall.
  static Vec3 hit(const Vec3& from, const Vec3& along) {
    double distance = 0;
    for (const double slope : {kSlope, -kSlope})
      distance = std::max(distance, (kNearest_m + slope * from.x() - from.z()) / (along.z() - slope * along.x()));
    return from + distance * along;
  }
  double grey(const Vec3& p) const { return waves_(130 * (p.x() + 0.3 * p.z()), 130 * p.y()); }

 private:
  Waves waves_{41, 6, 40};
};

struct Pose {
  Mat3 R_WC = Mat3::Identity();
  Vec3 p_WC = Vec3::Zero();
};

CameraParameters first_lens() {
  return {CameraModel::kPinholeRadialTangential, 320, 240, {200, 202, 158, 121}, {-0.1, 0.02, 1e-4, -2e-4, 0}};
}

/// A pair like that of a usual rig: not quite parallel, lenses of the same kind.
SecondRig usual_rig() {
  SecondRig rig;
  rig.camera = first_lens();
  rig.camera.intrinsics = {203, 201, 163, 118};
  rig.R_SC = Eigen::AngleAxisd(0.02, Vec3(0.3, 1, -0.5).normalized()).toRotationMatrix();
  rig.p_SC = Vec3(-0.11, 0.002, 0.004);
  return rig;
}

/// Another model, size and focal length.
SecondRig mixed_rig() {
  SecondRig rig = usual_rig();
  rig.camera = {CameraModel::kPinholeEquidistant, 300, 200, {188, 187, 148, 102}, {0.02, -0.01, 0, 0, 0}};
  return rig;
}

TestImage picture(const Camera& camera, const Pose& pose, const Wedge& wedge) {
  TestImage image(camera.width(), camera.height());
  image.fill([&](int x, int y) {
    Vec3 f;
    return camera.unproject(Vec2(x, y), f) ? wedge.grey(Wedge::hit(pose.p_WC, pose.R_WC * f)) : 0;
  });
  return image;
}

Frame frame_of(const TestImage& image, int number) {
  return {HostStamp{50'000'000LL * number},
          static_cast<std::uint64_t>(number),
          image.pixels.data(),
          image.width,
          image.height,
          image.stride};
}

/// Both cameras on a path, and the true place of each view.
class Rig {
 public:
  explicit Rig(const SecondRig& real, const SecondRig& believed, const TrackerConfig& config = {})
      : rig_(real),
        first_(first_lens()),
        second_(real.camera),
        tracker(first_, config),
        second(first_, believed, config) {}
  explicit Rig(const SecondRig& rig) : Rig(rig, rig) {}

  enum class Second { kSeen, kCovered, kMissing };

  /// The second camera takes its images so much later; images are 50 ms apart.
  double later_s = 0;
  Vec3 velocity_error = Vec3::Zero();                  ///< m/s, of the velocity that the tracker gets
  Vec3 turn = 0.004 * Vec3(0.2, 1, 0.4).normalized();  ///< from image to image

  /// `first`: false: the first camera shows nothing.
  const TrackedFrame& step(Second what = Second::kSeen, bool first = true) {
    const Pose pose = pose_at(number_), later = pose_at(number_ + later_s / kPeriod_s);
    pose_ = pose;
    second_pose_ = {later.R_WC * rig_.R_SC.transpose(), later.p_WC - later.R_WC * rig_.R_SC.transpose() * rig_.p_SC};
    if (first) {  // what it was shown last stays until it is shown another one
      std::swap(images_[0], images_[1]);
      images_[0] = std::make_unique<TestImage>(picture(first_, pose, wedge_));
    }
    std::swap(seconds_[0], seconds_[1]);
    seconds_[0] = std::make_unique<TestImage>(picture(second_, second_pose_, wedge_));
    if (what == Second::kCovered) std::fill(seconds_[0]->pixels.begin(), seconds_[0]->pixels.end(), 3);
    ++number_;
    const HeapCallScope heap;
    const Mat3 R_CC0 = so3_exp(-turn);
    if (first) tracker.step(frame_of(*images_[0], number_), R_CC0, *out);
    if (!first) out->features.clear();
    const RigMotion motion{
        later_s, {turn / kPeriod_s, Vec3::Zero()}, {}, pose.R_WC.transpose() * kStep_m / kPeriod_s + velocity_error};
    second.step(first ? &tracker.pyramid() : nullptr, out->features,
                what == Second::kMissing ? Frame{} : frame_of(*seconds_[0], number_),
                rig_.R_SC * R_CC0 * rig_.R_SC.transpose(), out->others[0], later_s == 0 ? RigMotion{} : motion);
    EXPECT_EQ(heap.calls(), 0);
    check();
    return *out;
  }
  /// Where the second camera sees the point of the track; false: nowhere.
  bool truth(const TrackedFeature& f, Vec2& px) const {
    const Vec3 p = Wedge::hit(pose_.p_WC, pose_.R_WC * Vec3(f.bearing.data()));
    const Vec3 p_S = second_pose_.R_WC.transpose() * (p - second_pose_.p_WC);
    constexpr double kMargin = 12;
    return second_.project(p_S, px) && px.x() > kMargin && px.y() > kMargin && px.x() < second_.width() - kMargin &&
           px.y() < second_.height() - kMargin;
  }
  const Camera& second_camera() const { return second_; }

 private:
  static constexpr double kPeriod_s = 0.05;
  inline static const Vec3 kStep_m{0.02, 0.01, 0.015};  // from image to image
  Pose pose_at(double number) const { return {so3_exp(number * turn), number * kStep_m}; }
  /// What holds for any input.
  void check() {
    std::map<std::uint32_t, std::uint32_t> found;
    ASSERT_LE(out->others[0].views.size(), out->features.size());
    const TrackedFeature* feature = out->features.begin();
    for (const SecondView& view : out->others[0].views) {
      while (feature != out->features.end() && feature->id < view.id) ++feature;
      ASSERT_NE(feature, out->features.end());
      EXPECT_EQ(feature->id, view.id);
      EXPECT_EQ(feature->age, view.age);
      EXPECT_LT(view.found, view.age) << "a view must be found again before it counts";
      const auto before = found_.find(view.id);
      if (before != found_.end()) {
        EXPECT_EQ(view.found, before->second) << "followed from image to image";
      }
      found.emplace(view.id, view.found);
    }
    found_ = std::move(found);
    for (std::size_t i = 0; i < out->others[0].alone.size(); ++i) {
      EXPECT_NE(out->others[0].alone[i].id & first_track_of(1), 0u);
      if (i > 0) {
        EXPECT_LT(out->others[0].alone[i - 1].id, out->others[0].alone[i].id);
      }
    }
  }

  SecondRig rig_;
  Camera first_, second_;
  Wedge wedge_;
  Pose pose_, second_pose_;
  int number_ = 0;
  std::map<std::uint32_t, std::uint32_t> found_;  ///< by id, of the last image
  std::unique_ptr<TestImage> images_[2], seconds_[2];

 public:
  Tracker tracker;
  SecondTracker second;
  std::unique_ptr<TrackedFrame> out = std::make_unique<TrackedFrame>();
};

const TrackedFeature* feature_of(const TrackedFrame& frame, std::uint32_t id) {
  const auto* const f = std::find_if(frame.features.begin(), frame.features.end(),
                                     [&](const TrackedFeature& feature) { return feature.id == id; });
  return f == frame.features.end() ? nullptr : f;
}

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

TEST(SecondTracker, NoViewLiesFarFromTheEpipolarPlane) {
  const SecondRig rig = usual_rig();
  Rig flight(rig);
  for (int image = 0; image < 5; ++image) {
    const TrackedFrame& frame = flight.step();
    for (const SecondView& view : frame.others[0].views) {
      const Vec3 normal = (rig.R_SC * Vec3(feature_of(frame, view.id)->bearing.data())).cross(rig.p_SC).normalized();
      EXPECT_LT(std::abs(normal.dot(Vec3(view.bearing.data()))) * 203, 1.1 * SecondTracker::kMostOffPlane_px);
    }
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
