#include "estimator/window/choose_tracks.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>
#include <set>

namespace epiline::test {
namespace {

/// A feature so many pixels from the middle of an image of 752 x 480.
TrackedFeature feature(std::uint32_t id, double u, double v) {
  TrackedFeature f;
  f.id = id;
  f.pixel = {static_cast<float>(376 + u), static_cast<float>(240 + v)};
  f.bearing = {0, 0, 1};
  f.pixel_jacobian = {458, 0, 0, 0, 458, 0};
  return f;
}

void add(Window& w, const std::vector<TrackedFeature>& features) {
  TrackedFrame frame;
  for (const TrackedFeature& f : features) frame.features.push_back(f);
  w.append();
  w.observe(frame);
}

std::set<std::uint32_t> used(const Window& w) {
  std::set<std::uint32_t> ids;
  for (int i = 0; i < w.track_count(); ++i)
    if (w.track(i).in_use && w.views(w.track(i)) >= 2) ids.insert(w.track(i).id);
  return ids;
}

TEST(ChooseTracks, WithoutALimitAllAreUsed) {
  const auto w = std::make_unique<Window>(6);
  std::vector<TrackedFeature> all;
  for (std::uint32_t id = 0; id < 50; ++id) all.push_back(feature(id, 7.0 * id, 3.0 * id));
  add(*w, all);
  add(*w, all);
  add(*w, {feature(99, 0, 0)});  // one view
  EXPECT_EQ(choose_tracks(*w, 10).used, 10);
  for (const int most : {0, 50, 400}) {
    const ChosenTracks chosen = choose_tracks(*w, most);
    EXPECT_EQ(chosen.offered, 50);
    EXPECT_EQ(chosen.used, 50);
    EXPECT_EQ(used(*w).size(), 50u);
  }
}

// Spare ones cost time; where the first camera sees too little, they carry the flight.
TEST(ChooseTracks, TakesTheSecondCamerasOwnWhereTheyAreAFourthOfTheFirsts) {
  const auto w = std::make_unique<Window>(6);
  w->rig.use[1] = true;
  const auto both = [&](std::uint32_t by_first, std::uint32_t by_second) {
    TrackedFrame frame;
    for (std::uint32_t id = 0; id < by_first; ++id) frame.features.push_back(feature(id, 7.0 * id, 3.0 * id));
    for (std::uint32_t id = 0; id < by_second; ++id)
      frame.others[0].alone.push_back(feature(first_track_of(1) | id, 9.0 * id, 2.0 * id));
    w->append();
    w->observe(frame);
  };
  both(40, 9);
  both(40, 9);
  EXPECT_EQ(choose_tracks(*w, 0).used, 40) << "of the second camera 9 are left";
  both(36, 9);
  EXPECT_EQ(choose_tracks(*w, 0).used, 49);
  both(0, 9);
  EXPECT_EQ(choose_tracks(*w, 0).used, 49);
}

// 100 tracks crowd in one corner and are older than the 20 that are spread: those are all taken.
TEST(ChooseTracks, SpreadsThemOverTheView) {
  const auto w = std::make_unique<Window>(6);
  std::vector<TrackedFeature> all;
  for (std::uint32_t id = 0; id < 100; ++id) all.push_back(feature(id, -320 + 0.3 * id, -200 + 0.1 * id));
  for (std::uint32_t id = 100; id < 120; ++id)
    all.push_back(feature(id, -240 + 130.0 * ((id - 100) % 5), -100 + 70.0 * ((id - 100) / 5)));
  add(*w, all);
  add(*w, all);
  EXPECT_EQ(choose_tracks(*w, 24).used, 24);
  const auto ids = used(*w);
  EXPECT_EQ(ids.size(), 24u);
  for (std::uint32_t id = 100; id < 120; ++id) EXPECT_TRUE(ids.count(id)) << id;
}

TEST(ChooseTracks, PrefersTheOldAndThoseStillSeen) {
  const auto w = std::make_unique<Window>(6);
  add(*w, {feature(1, 0, 0), feature(2, 1, 0), feature(3, 2, 0)});
  add(*w, {feature(1, 0, 0), feature(2, 1, 0), feature(3, 2, 0)});
  add(*w, {feature(2, 1, 0), feature(3, 2, 0)});
  choose_tracks(*w, 1);
  EXPECT_EQ(used(*w), (std::set<std::uint32_t>{2}));
  choose_tracks(*w, 2);
  EXPECT_EQ(used(*w), (std::set<std::uint32_t>{2, 3}));
}

// Points drift through the view and are replaced as they leave it: what is chosen stays chosen nearly always.
TEST(ChooseTracks, HardlyChangesFromFrameToFrame) {
  const auto w = std::make_unique<Window>(8);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> u(-370, 370), v(-230, 230);
  std::vector<std::array<double, 3>> points;
  std::uint32_t next = 0;
  for (; next < 200; ++next) points.push_back({static_cast<double>(next), u(random), v(random)});
  std::set<std::uint32_t> before;
  int kept = 0, compared = 0;
  for (int k = 0; k < 60; ++k) {
    std::vector<TrackedFeature> features;
    for (auto& p : points) {
      p[1] += 4;
      if (p[1] > 370) p = {static_cast<double>(next++), -370, v(random)};
      features.push_back(feature(static_cast<std::uint32_t>(p[0]), p[1], p[2]));
    }
    if (w->size() >= w->capacity()) w->remove(0);
    add(*w, features);
    w->prune();
    choose_tracks(*w, 80);
    const auto now = used(*w);
    for (const std::uint32_t id : before) {
      const int i = w->find(id);
      if (i < 0 || !w->seen(w->track(i), w->size() - 1)) continue;  // left the view
      ++compared;
      kept += static_cast<int>(now.count(id));
    }
    before = now;
  }
  EXPECT_GT(kept, 0.9 * compared);
}

}  // namespace
}  // namespace epiline::test
