// Bookkeeping of frames and tracks against a naive model that keeps everything in maps; the limits of capacity.
#include "estimator/window/window.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <set>
#include <vector>

#include "estimator/geometry/tracked_feature.h"

namespace epiline::test {
namespace {

/// A feature one can recognise again: `tag` is in its Jacobian.
TrackedFeature feature(std::uint32_t id, double tag) {
  TrackedFeature f;
  f.id = id;
  f.bearing = {0, 0, 1};
  f.pixel_jacobian = {tag, 0, 0, 0, 400, 0};
  return f;
}

TrackedFrame frame_of(const std::vector<std::uint32_t>& ids, double tag = 0) {
  TrackedFrame frame;
  for (const std::uint32_t id : ids) frame.features.push_back(feature(id, tag + id));
  return frame;
}

struct Naive {
  struct Frame {
    std::uint64_t id;
    std::map<std::uint32_t, double> seen;  ///< track -> tag
  };
  std::vector<Frame> frames;
  std::set<std::uint32_t> tracks;

  int views(std::uint32_t track) const {
    int n = 0;
    for (const Frame& f : frames) n += static_cast<int>(f.seen.count(track));
    return n;
  }
  void prune() {
    std::erase_if(tracks, [&](std::uint32_t t) {
      const bool gone = !frames.back().seen.count(t) && views(t) < 2;
      if (gone)
        for (Frame& f : frames) f.seen.erase(t);
      return gone;
    });
  }
};

void expect_same(const Window& w, const Naive& n) {
  RC_ASSERT(w.size() == static_cast<int>(n.frames.size()));
  RC_ASSERT(w.track_count() == static_cast<int>(n.tracks.size()));
  for (int k = 0; k < w.size(); ++k) {
    RC_ASSERT(w.at(k).id == n.frames[static_cast<std::size_t>(k)].id);
    RC_ASSERT(w.index_of(w.at(k).id) == k);
  }
  for (const std::uint32_t id : n.tracks) {
    const int i = w.find(id);
    RC_ASSERT(i >= 0);
    const TrackRecord& t = w.track(i);
    RC_ASSERT(t.id == id);
    RC_ASSERT(w.views(t) == n.views(id));
    for (int k = 0; k < w.size(); ++k) {
      const auto& seen = n.frames[static_cast<std::size_t>(k)].seen;
      const auto it = seen.find(id);
      RC_ASSERT(w.seen(t, k) == (it != seen.end()));
      if (it != seen.end()) RC_ASSERT(chart_of(w.view(t, k))(0, 0) == it->second);
    }
  }
}

RC_GTEST_PROP(Window, KeepsTheSameBooksAsANaiveModel, ()) {
  const auto w = std::make_unique<Window>(*rc::gen::inRange(3, kMaxFrames + 1));
  Naive naive;
  std::set<std::uint64_t> ids;
  double tag = 0;
  const int steps = *rc::gen::inRange(1, 60);
  for (int step = 0; step < steps; ++step) {
    const int what = *rc::gen::inRange(0, 4);
    if (what >= 2 && w->size() < w->capacity()) {
      // ids far apart and ids whose hashes collide (multiples of 2^20), of which there are fewer than may be asked for
      const auto drawn = *rc::gen::container<std::vector<std::uint32_t>>(
          rc::gen::oneOf(rc::gen::inRange<std::uint32_t>(0, 30),
                         rc::gen::map(rc::gen::inRange<std::uint32_t>(0, 8), [](std::uint32_t i) { return i << 20; })));
      const std::set<std::uint32_t> seen(drawn.begin(), drawn.end());
      Slot& slot = w->append();
      RC_ASSERT(ids.insert(slot.id).second);  // never reused
      RC_ASSERT(!slot.at_rest && slot.imu.T == 0);
      slot.at_rest = true;  // the next slot at this place must not have it
      slot.imu.T = 1;
      naive.frames.push_back({slot.id, {}});
      TrackedFrame frame;
      for (const std::uint32_t id : seen) {
        frame.features.push_back(feature(id, ++tag));
        naive.frames.back().seen[id] = tag;
        naive.tracks.insert(id);
      }
      RC_ASSERT(w->observe(frame).without_room == 0);
    } else if (what == 1 && w->size() > 1) {
      const int k = *rc::gen::inRange(0, w->size());
      w->remove(k);
      naive.frames.erase(naive.frames.begin() + k);
    } else if (what == 0 && w->size() > 0) {
      w->prune();
      naive.prune();
      for (std::uint32_t id = 0; id < 40; ++id) RC_ASSERT((w->find(id) >= 0) == (naive.tracks.count(id) > 0));
    }
    expect_same(*w, naive);
  }
}

TEST(Window, RefusesAndCountsTracksBeyondItsCapacity) {
  const auto w = std::make_unique<Window>(5);
  std::uint32_t next = 0;
  auto fresh = [&](int count) {
    std::vector<std::uint32_t> ids;
    for (int i = 0; i < count; ++i) ids.push_back(next++);
    return frame_of(ids);
  };
  w->append();
  EXPECT_EQ(w->observe(fresh(400)).without_room, 0);
  w->append();
  EXPECT_EQ(w->observe(fresh(400)).without_room, 0);
  w->append();
  EXPECT_EQ(w->observe(fresh(400)).without_room, 3 * 400 - kMaxTracks);
  EXPECT_EQ(w->track_count(), kMaxTracks);
  EXPECT_EQ(w->find(1100), -1);
  // known tracks are still followed
  w->append();
  EXPECT_EQ(w->observe(frame_of({0, 5, 2000}, 0.5)).without_room, 1);
  EXPECT_EQ(w->views(w->track(w->find(5))), 2);
  EXPECT_EQ(chart_of(w->view(w->track(w->find(5)), 3))(0, 0), 5.5);
  // and there is room again once the others are forgotten
  w->prune();
  EXPECT_EQ(w->track_count(), 2);
  EXPECT_EQ(w->observe(frame_of({2000})).without_room, 0);
}

TEST(Window, StartsAReusedIdAfresh) {
  const auto w = std::make_unique<Window>(5);
  w->append();
  w->observe(frame_of({7}));
  w->append();
  w->observe(frame_of({8}));
  w->prune();
  EXPECT_EQ(w->find(7), -1);
  w->append();
  w->observe(frame_of({7}, 0.25));
  ASSERT_GE(w->find(7), 0);
  const TrackRecord& t = w->track(w->find(7));
  EXPECT_EQ(w->views(t), 1);
  EXPECT_FALSE(w->seen(t, 0));
  EXPECT_EQ(chart_of(w->view(t, 2))(0, 0), 7.25);
}

TEST(Window, ClearForgetsEverythingButTheCalibration) {
  const auto w = std::make_unique<Window>(5);
  w->calibration.time_offset = 0.01;
  w->prior.frames = 3;
  const std::uint64_t before = w->append().id;
  w->observe(frame_of({1, 2, 3}));
  w->clear();
  EXPECT_EQ(w->size(), 0);
  EXPECT_EQ(w->track_count(), 0);
  EXPECT_EQ(w->find(2), -1);
  EXPECT_EQ(w->prior.dim(), 0);
  EXPECT_EQ(w->calibration.time_offset, 0.01);
  EXPECT_NE(w->append().id, before);
}

TEST(Calibration, LocalUndoesRetract) {
  Calibration c;
  c.R_BC = so3_exp(Vec3(0.3, -1, 2));
  c.p_BC = Vec3(1, 2, 3);
  CalibrationTangent d;
  d << 0.01, 0.2, -0.1, 0.3, 0.5, 0.6, -0.7, 0.02, 0.05, -0.03, 0.04;
  Calibration moved = c;
  retract(moved, d);
  EXPECT_TRUE(local(c, moved).isApprox(d, 1e-12));
  EXPECT_TRUE(moved.R_BC.isApprox(c.R_BC * so3_exp(d.segment<3>(1)), 1e-12));
}

/// One of them among others must be left out and counted, the others taken: a number that is none would reach the prior
/// and stay there.
TEST(Window, LeavesOutFeaturesThatNoCameraGives) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN(), kInfinite = std::numeric_limits<double>::infinity();
  using Change = std::function<void(TrackedFeature&)>;
  const std::vector<Change> changes = {
      [](TrackedFeature& f) { f.bearing[1] = kNan; },        [](TrackedFeature& f) { f.bearing[2] = kInfinite; },
      [](TrackedFeature& f) { f.bearing = {0, 0, 0}; },      [](TrackedFeature& f) { f.bearing = {0, 0, 1.1}; },
      [](TrackedFeature& f) { f.pixel_jacobian[3] = kNan; }, [](TrackedFeature& f) { f.pixel_jacobian[0] = kInfinite; },
      [](TrackedFeature& f) { f.pixel_jacobian = {}; },      [](TrackedFeature& f) { f.pixel_jacobian[4] = 1e9; }};
  for (const Change& change : changes) {
    auto w = std::make_unique<Window>(5);
    w->append();
    TrackedFrame frame = frame_of({1, 2, 3}, 100);
    change(frame.features[1]);
    const Window::Observed seen = w->observe(frame);
    EXPECT_EQ(seen.impossible, 1);
    EXPECT_EQ(w->track_count(), 2);
    EXPECT_EQ(w->find(2), -1);
  }
}

/// What a longer focal length does to what a camera sees, found by projecting with it.
TEST(Window, KnowsHowALensBends) {
  const CameraParameters lenses[] = {
      {CameraModel::kPinholeRadialTangential, 752, 480, {458, 458, 367, 248}, {-0.28, 0.07, 2e-4, 2e-5}},
      {CameraModel::kPinholeRadialTangential, 752, 480, {458, 458, 367, 248}, {}},
      {CameraModel::kPinholeEquidistant, 512, 512, {190, 190, 255, 256}, {3e-3, 7e-4, -2e-3, 2e-4}},
      {CameraModel::kDoubleSphere, 512, 512, {157, 157, 255, 256}, {-0.18, 0.59}}};
  constexpr double kLonger = 1e-4;
  for (const CameraParameters& lens : lenses) {
    CameraParameters longer = lens;
    for (int i = 0; i < 2; ++i) longer.intrinsics[static_cast<std::size_t>(i)] /= 1 - kLonger;
    const Camera configured(lens), real(longer);
    for (const double angle : {0.0, 0.04, 0.1, 0.4, 0.6, 1.1, 1.5, 1.8})
      for (const double turned : {0.3, 2.0, 5.0}) {
        const Vec3 X(std::sin(angle) * std::cos(turned), std::sin(angle) * std::sin(turned), std::cos(angle));
        Vec2 pixel;
        Vec3 seen;
        TrackedFrame frame;
        frame.features.push_back(TrackedFeature{});
        if (!configured.project(X, pixel) || !set_pixel(configured, pixel, frame.features[0])) continue;
        if (!real.project(X, pixel) || !configured.unproject(pixel, seen)) continue;
        Window w(3);
        w.append();
        w.observe(frame);
        const double bend = static_cast<double>(w.view(w.track(0), 0).bend);
        const Vec3 taken_for = X - kLonger * (bend * X.z() + (1 - bend) * X.norm()) * Vec3::UnitZ();
        // of the angle by which it moves: tangential distortion is no part of the bend
        EXPECT_LT(seen.cross(taken_for.normalized()).norm(), 0.01 * kLonger * std::sin(angle) + 1e-8)
            << static_cast<int>(lens.model) << " at " << angle;
      }
  }
}

}  // namespace
}  // namespace epiline::test
