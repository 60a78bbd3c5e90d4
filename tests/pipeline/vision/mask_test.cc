// A mask: where a camera sees its own vehicle, no track is.
#include "pipeline/vision/mask.h"

#include <gtest/gtest.h>

#include <memory>
#include <stdexcept>

#include "estimator/geometry/so3.h"
#include "pipeline/vision/tracker.h"
#include "platform/memory/allocation_count.h"
#include "tests/pipeline/vision/support.h"

namespace epiline {
namespace {

constexpr int kMaskWidth = 320, kMaskHeight = 240, kOwnFrom = 170;  // px: rows from there on show the vehicle
constexpr int kMaskMargin_px = 8;

TestImage masked(const std::function<bool(int, int)>& is_own, int width = kMaskWidth, int height = kMaskHeight) {
  TestImage picture(width, height);
  picture.fill([&](int x, int y) { return is_own(x, y) ? 0 : 255; });
  return picture;
}

bool is_hood(int, int y) { return y >= kOwnFrom; }

TEST(Mask, BlackGrowsByHalfAPatch) {
  const Mask mask(masked([](int x, int y) { return x == 100 && y == 50; }).view());
  for (int y = 30; y < 70; ++y)
    for (int x = 80; x < 120; ++x)
      EXPECT_EQ(mask.sees(static_cast<float>(x), static_cast<float>(y)),
                std::abs(x - 100) > kMaskMargin_px || std::abs(y - 50) > kMaskMargin_px);
  EXPECT_TRUE(mask.sees(-0.4f, 239.4f)) << "the nearest pixel counts";
  EXPECT_FALSE(mask.sees(-0.6f, 100));
  EXPECT_FALSE(mask.sees(100, 239.6f));
}

TEST(Mask, GreyBelowTheMiddleIsBlack) {
  TestImage picture(kMaskWidth, kMaskHeight);
  picture.fill([](int, int) { return 127; });
  EXPECT_FALSE(Mask(picture.view()).sees_anything());
  picture.at(100, 100) = 128;
  EXPECT_FALSE(Mask(picture.view()).sees_anything()) << "no patch has room there";
  picture.fill([](int x, int) { return x < 100 ? 128 : 0; });
  EXPECT_TRUE(Mask(picture.view()).sees_anything());
}

TEST(Mask, OfACellTheLargestRectangleThatSeesTheWorldIsSearched) {
  const Mask mask(masked(is_hood).view());
  const auto sides = [&](const Cell& c) {
    const Cell part = mask.seen_part(c);
    return std::array<int, 4>{part.x, part.y, part.width, part.height};
  };
  EXPECT_EQ(sides({20, 20, 40, 40}), (std::array<int, 4>{20, 20, 40, 40}));
  EXPECT_EQ(sides({20, 141, 40, 40}), (std::array<int, 4>{20, 141, 40, 20})) << "of 21 rows, even sides";
  EXPECT_EQ(mask.seen_part({20, 180, 40, 40}).width, 0);
  // a leg through the middle: the wider side of it
  const Mask leg(masked([](int x, int) { return x == 70; }).view());
  EXPECT_EQ(leg.seen_part({40, 40, 60, 40}).x, 40);
  EXPECT_EQ(leg.seen_part({40, 40, 60, 40}).width, 22);
}

Camera mask_camera() {
  CameraParameters p;
  p.width = kMaskWidth;
  p.height = kMaskHeight;
  p.intrinsics = {200, 200, 160, 120};
  return Camera(p);
}

/// The world moved by (x, y) px, behind a part of the vehicle that stays.
TestImage view_past_the_hood(double x, double y, bool hood = true) {
  const Waves world(31, 5, 40), own(32, 5, 40);
  TestImage image = shifted(world, kMaskWidth, kMaskHeight, x, y);
  const TestImage part = shifted(own, kMaskWidth, kMaskHeight, 0, 0);
  const std::size_t from = hood ? static_cast<std::size_t>(kOwnFrom) * kMaskWidth : image.pixels.size();
  std::copy(part.pixels.begin() + static_cast<std::ptrdiff_t>(from), part.pixels.end(),
            image.pixels.begin() + static_cast<std::ptrdiff_t>(from));
  return image;
}

/// A world that slides past by (3, 2) px an image, behind a part of the vehicle that stays.
std::vector<int> tracks_on_the_vehicle(const TrackerConfig& config, std::vector<std::size_t>* all = nullptr) {
  Tracker tracker(mask_camera(), config);
  std::vector<TestImage> images;
  for (int k = 0; k < 15; ++k) images.push_back(view_past_the_hood(3 * k, 2 * k));
  std::vector<int> counts;
  const auto out = std::make_unique<TrackedFrame>();
  for (int k = 0; k < 15; ++k) {
    const TestImage& image = images[static_cast<std::size_t>(k)];
    const HeapCallScope heap;
    tracker.step(frame_of(image, k), Mat3::Identity(), *out);
    EXPECT_EQ(heap.calls(), 0);
    int on_it = 0;
    for (const TrackedFeature& f : out->features) on_it += f.pixel[1] + 0.5f >= kOwnFrom - kMaskMargin_px;
    counts.push_back(on_it);
    if (all) all->push_back(out->features.size());
  }
  return counts;
}

TEST(Mask, NoTrackIsWhereItIsBlack) {
  const auto without = tracks_on_the_vehicle({});
  EXPECT_GT(without.front(), 10);
  EXPECT_GT(without.back(), 10);
  TrackerConfig config;
  config.masks[0] = std::make_shared<const Mask>(masked(is_hood).view());
  std::vector<std::size_t> all;
  EXPECT_EQ(tracks_on_the_vehicle(config, &all), std::vector<int>(15, 0)) << "neither begun nor followed there";
  EXPECT_GT(all.back(), 40u);
}

/// The camera yaws to and fro, or only to, before a world that is far away; from `kOwnFrom` on it sees the vehicle. How
/// much of that is found, and how many cells of the world are taken for it, as shares.
struct Found {
  double own, world;
};
Found own_parts_found(bool to_and_fro, bool hood) {
  Tracker tracker(mask_camera(), {});
  const auto out = std::make_unique<TrackedFrame>();
  double at_px = 0;
  std::array<TestImage, 2> images{TestImage(kMaskWidth, kMaskHeight), TestImage(kMaskWidth, kMaskHeight)};
  for (int k = 0; k < 120; ++k) {
    TestImage& image = images[static_cast<std::size_t>(k % 2)];  // that of before is still needed
    const double step_px = to_and_fro && k / 20 % 2 == 1 ? -4 : 4;
    at_px += step_px;
    image = view_past_the_hood(at_px, 0, hood);
    const Mat3 R_CC0 = so3_exp(Vec3(0, step_px / 200, 0));
    tracker.step(frame_of(image, k), R_CC0, *out);
  }
  const OwnCells& cells = tracker.stats().own_cells;
  int of_own = 0, found_own = 0, of_world = 0, found_world = 0;
  for (int i = 0; i < cells.columns * cells.rows; ++i) {
    const int top = cells.border_px + i / cells.columns * cells.height_px, bottom = top + cells.height_px;
    const bool found = cells.own[static_cast<std::size_t>(i)];
    if (top >= kOwnFrom) ++of_own, found_own += found;
    if (bottom < kOwnFrom - kMaskMargin_px) ++of_world, found_world += found;
  }
  return {found_own / static_cast<double>(of_own), found_world / static_cast<double>(of_world)};
}

TEST(OwnParts, AreFoundByWhatStaysWhileTheCameraTurns) {
  const Found found = own_parts_found(true, true);
  EXPECT_GT(found.own, 0.7);
  EXPECT_EQ(found.world, 0);
}

TEST(OwnParts, WhatStaysWhileTheCameraTurnsOneWayMayBeCircled) { EXPECT_EQ(own_parts_found(false, true).own, 0); }

TEST(OwnParts, OfTheWorldAloneNothingIsTaken) {
  const Found found = own_parts_found(true, false);
  EXPECT_EQ(found.own + found.world, 0);
}

TEST(Mask, AnotherSizeThanTheImagesIsRefused) {
  TrackerConfig config;
  config.masks[0] = std::make_shared<const Mask>(masked(is_hood, 320, 200).view());
  EXPECT_THROW(Tracker(mask_camera(), config), std::invalid_argument);
  EXPECT_NO_THROW(Tracker(mask_camera(), config, 1)) << "the mask of another camera";
}

}  // namespace
}  // namespace epiline
