#pragma once
// Two cameras that move before a wedge, and the true place of each view.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <map>
#include <memory>

#include "pipeline/vision/second_tracker.h"
#include "pipeline/vision/tracker.h"
#include "platform/memory/allocation_count.h"
#include "tests/pipeline/vision/support.h"

namespace epiline::test {

inline constexpr double kNearest_m = 1.6, kSlope = 0.5;  // of the edge towards the cameras; of the walls beside it

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

inline CameraParameters first_lens() {
  return {CameraModel::kPinholeRadialTangential, 320, 240, {200, 202, 158, 121}, {-0.1, 0.02, 1e-4, -2e-4, 0}};
}

/// A pair like that of a usual rig: not quite parallel, lenses of the same kind.
inline SecondRig usual_rig() {
  SecondRig rig;
  rig.camera = first_lens();
  rig.camera.intrinsics = {203, 201, 163, 118};
  rig.R_SC = Eigen::AngleAxisd(0.02, Vec3(0.3, 1, -0.5).normalized()).toRotationMatrix();
  rig.p_SC = Vec3(-0.11, 0.002, 0.004);
  return rig;
}

/// Another model, size and focal length.
inline SecondRig mixed_rig() {
  SecondRig rig = usual_rig();
  rig.camera = {CameraModel::kPinholeEquidistant, 300, 200, {188, 187, 148, 102}, {0.02, -0.01, 0, 0, 0}};
  return rig;
}

inline TestImage picture(const Camera& camera, const Pose& pose, const Wedge& wedge) {
  TestImage image(camera.width(), camera.height());
  image.fill([&](int x, int y) {
    Vec3 f;
    return camera.unproject(Vec2(x, y), f) ? wedge.grey(Wedge::hit(pose.p_WC, pose.R_WC * f)) : 0;
  });
  return image;
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

inline const TrackedFeature* feature_of(const TrackedFrame& frame, std::uint32_t id) {
  const auto* const f = std::find_if(frame.features.begin(), frame.features.end(),
                                     [&](const TrackedFeature& feature) { return feature.id == id; });
  return f == frame.features.end() ? nullptr : f;
}

}  // namespace epiline::test
