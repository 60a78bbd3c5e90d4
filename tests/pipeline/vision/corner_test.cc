#include "pipeline/vision/corner.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <opencv2/imgproc.hpp>

#include "pipeline/vision/detector.h"
#include "tests/pipeline/vision/support.h"

namespace epiline {
namespace {

const float kEdgeShare = TrackerConfig{}.edge_share;

// Score of the 6x6 px round the 2x2 block whose top left pixel is (x, y), straight from its definition.
double reference_score(const TestImage& image, int x, int y) {
  double xx = 0, xy = 0, yy = 0;
  for (int v = y - 2; v <= y + 3; ++v) {
    for (int u = x - 2; u <= x + 3; ++u) {
      const double gx = 0.5 * (image.at(u + 1, v) - image.at(u - 1, v));
      const double gy = 0.5 * (image.at(u, v + 1) - image.at(u, v - 1));
      xx += gx * gx, xy += gx * gy, yy += gy * gy;
    }
  }
  const double middle = 0.5 * (xx + yy), radius = std::hypot(0.5 * (xx - yy), xy);
  return (middle - radius - static_cast<double>(kEdgeShare) * (middle + radius)) / 36;
}

Corner reference_corner(const TestImage& image, const Cell& cell, const Discs& taken) {
  Corner best;
  for (int y = cell.y; y < cell.y + cell.height; y += 2) {
    for (int x = cell.x; x < cell.x + cell.width; x += 2) {
      bool is_free = true;
      for (int i = 0; i < taken.count; ++i)
        is_free &= std::hypot(x + 0.5 - taken.x[i], y + 0.5 - taken.y[i]) > taken.radius;
      const double score = reference_score(image, x, y);
      if (is_free && score > best.score * (1 + 1e-5) + 1e-6) {
        best = {static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f, static_cast<float>(score)};
      }
    }
  }
  return best;
}

void expect_same(const Corner& found, const Corner& expected, const TestImage& image) {
  EXPECT_NEAR(found.score, expected.score, 1e-4 * expected.score + 1e-4);
  if (found.score > 0) {  // equal scores may be taken in another order
    EXPECT_NEAR(found.score, reference_score(image, static_cast<int>(found.x), static_cast<int>(found.y)),
                1e-4 * found.score + 1e-4);
  }
}

TEST(Corner, EqualsTheDefinitionForEveryCellSize) {
  std::mt19937 random(1);
  const TestImage image = random_image(kMaxCellSide + 9, kMaxCellSide + 8, random);
  on_every_target([&] {
    for (int side = 2; side <= kMaxCellSide; side += side < 80 ? 2 : 20) {
      const Cell cell{4 + side % 3, 4, side, std::min(side, 24)};
      const Corner found = best_corner(image.view(), cell, {}, kEdgeShare),
                   expected = reference_corner(image, cell, {});
      expect_same(found, expected, image);
      EXPECT_FLOAT_EQ(found.x, expected.x) << "side " << side;
      EXPECT_FLOAT_EQ(found.y, expected.y) << "side " << side;
    }
  });
}

TEST(Corner, BlackAndWhiteDoNotOverflow) {
  on_every_target([&] {
    for (int period : {1, 2, 3, 5, 8}) {
      TestImage image(70, 70);
      image.fill([&](int x, int y) { return ((x / period) ^ (y / period)) % 2 ? 255 : 0; });
      const Cell cell{6, 5, 44, 44};
      expect_same(best_corner(image.view(), cell, {}, kEdgeShare), reference_corner(image, cell, {}), image);
    }
  });
}

TEST(Corner, OfEqualCornersTheFirstIsTaken) {
  on_every_target([&] {
    for (const auto& [second_x, second_y] : {std::pair{40, 20}, std::pair{20, 40}, std::pair{10, 40}}) {
      TestImage image(70, 70);
      const auto in_spot = [](int x, int y, int left, int top) { return x / 2 == left / 2 && y / 2 == top / 2; };
      image.fill([&, sx = second_x, sy = second_y](int x, int y) {
        return in_spot(x, y, 20, 20) || in_spot(x, y, sx, sy) ? 200 : 50;
      });
      const Corner found = best_corner(image.view(), Cell{4, 4, 52, 52}, {}, kEdgeShare);
      EXPECT_GT(found.score, 0);
      EXPECT_NEAR(found.x, 20.5, 4) << second_x << ", " << second_y;
      EXPECT_NEAR(found.y, 20.5, 4) << second_x << ", " << second_y;
    }
  });
}

TEST(Corner, KeepsItsDistance) {
  std::mt19937 random(2);
  std::uniform_real_distribution<float> place(-10, 80);
  on_every_target([&] {
    for (int round = 0; round < 200; ++round) {
      const TestImage image = random_image(72, 66, random, 80);
      std::vector<float> x(5), y(5);
      for (int i = 0; i < 5; ++i) x[i] = place(random), y[i] = place(random);
      const Discs taken{x.data(), y.data(), 1 + round % 5, 4.f + static_cast<float>(round % 20)};
      const Cell cell{8, 8, 44, 40};
      const Corner found = best_corner(image.view(), cell, taken, kEdgeShare);
      expect_same(found, reference_corner(image, cell, taken), image);
      for (int i = 0; i < taken.count && found.score > 0; ++i) {
        EXPECT_GT(std::hypot(found.x - x[i], found.y - y[i]), taken.radius - 1e-3);
      }
    }
  });
}

TEST(Corner, NothingWhereAllIsTakenOrFlat) {
  std::mt19937 random(3);
  const TestImage noise = random_image(64, 64, random);
  TestImage grey(64, 64);
  const float x = 32, y = 32;
  EXPECT_EQ(best_corner(noise.view(), {8, 8, 44, 44}, {&x, &y, 1, 60}, kEdgeShare).score, 0);
  EXPECT_EQ(best_corner(grey.view(), {8, 8, 44, 44}, {}, kEdgeShare).score, 0);
}

// OpenCV with the same derivative (-1, 0, 1) and block: 255^2 / 4 times its value, and its even block sits one pixel
// further.
TEST(Corner, ScoreIsOfOpenCvsEigenvalues) {
  const Waves waves(4, 4, 30);
  const TestImage image = shifted(waves, 120, 100, 0, 0);
  cv::Mat expected;
  cv::cornerEigenValsAndVecs(cv::Mat(100, 120, CV_8UC1, const_cast<std::uint8_t*>(image.pixels.data())), expected, 6,
                             1);
  for (int y = 8; y < 90; y += 6) {
    for (int x = 8; x < 108; x += 6) {
      const auto& values = expected.at<cv::Vec6f>(y + 1, x + 1);
      for (const float share : {0.F, kEdgeShare}) {
        const Corner found = best_corner(image.view(), {x, y, 2, 2}, {}, share);
        const double score = std::max(0.F, std::min(values[0], values[1]) - share * std::max(values[0], values[1]));
        ASSERT_NEAR(found.score, score * 255 * 255 / 4, 2e-3 * values[0] * 255 * 255 / 4 + 1e-3) << x << ", " << y;
      }
    }
  }
}

// A lamp before a dim ceiling, of 8 sub-pixels a side and as noisy as a camera, at any angle: its corners are some, its
// edges are none.
TestImage lamp(double angle, std::mt19937& random) {
  TestImage image(200, 200);
  std::normal_distribution<double> noise(0, 2);
  image.fill([&](int x, int y) {
    int lit = 0;
    for (int k = 0; k < 64; ++k) {
      const double u = x - 99.5 + (k % 8 + 0.5) / 8 - 0.5, v = y - 99.5 + (k / 8 + 0.5) / 8 - 0.5;
      const double along = u * std::cos(angle) + v * std::sin(angle);
      const double across = v * std::cos(angle) - u * std::sin(angle);
      lit += std::abs(along) < 60 && std::abs(across) < 15 ? 1 : 0;
    }
    return 60 + 195 * lit / 64. + noise(random);
  });
  return image;
}

TEST(Detector, TakesTheCornersOfALampNotItsEdges) {
  std::mt19937 random(7);
  TrackerConfig config, with_edges;
  with_edges.edge_share = 0;
  int on_edges = 0;
  for (double angle = 0.02; angle < std::numbers::pi; angle += 0.2) {
    const TestImage image = lamp(angle, random);
    const auto from_corner = [&](float x, float y) {
      double least = 1e9;
      for (const double along : {-60., 60.})
        for (const double across : {-15., 15.})
          least = std::min(least, std::hypot(x - 99.5 - along * std::cos(angle) + across * std::sin(angle),
                                             y - 99.5 - along * std::sin(angle) - across * std::cos(angle)));
      return least;
    };
    const auto detect = [&](const TrackerConfig& c) {
      auto tracks = std::make_unique<TrackTable>();
      Detector detector(200, 200, c);
      detector.detect(image.view(), {}, 150, *tracks);
      return tracks;
    };
    const auto tracks = detect(config), edges = detect(with_edges);
    EXPECT_GE(tracks->size, 2) << angle;
    for (int i = 0; i < tracks->size; ++i) EXPECT_LT(from_corner(tracks->x[i], tracks->y[i]), 8) << angle;
    for (int i = 0; i < edges->size; ++i) on_edges += from_corner(edges->x[i], edges->y[i]) > 8 ? 1 : 0;
  }
  EXPECT_GT(on_edges, 20) << "noise makes none of the edges a corner: the test shows nothing";
}

// -------------------------------------------------------------------------------------------------------------
// detector

TEST(Detector, DividesTheImageIntoAboutOneCellAFeature) {
  const Detector euroc(752, 480, {});
  EXPECT_EQ(euroc.columns(), 16);
  EXPECT_EQ(euroc.rows(), 10);
  EXPECT_EQ(euroc.cell(0).width, 44);
  EXPECT_EQ(euroc.cell(0).height, 44);
  TrackerConfig few;
  few.max_features = 1;
  const Detector large(2048, 1536, few);
  EXPECT_LE(large.cell(0).width, kMaxCellSide);
  EXPECT_LE(large.cell(0).height, kMaxCellSide);
}

RC_GTEST_PROP(Detector, CellsStayInsideTheBorderAndDoNotOverlap, ()) {
  const int width = *rc::gen::inRange(64, 2049), height = *rc::gen::inRange(64, 1537);
  TrackerConfig config;
  config.max_features = *rc::gen::inRange(1, TrackTable::kCapacity + 1);
  const Detector detector(width, height, config);
  for (int i = 0; i < detector.columns() * detector.rows(); ++i) {
    const Cell c = detector.cell(i);
    RC_ASSERT(c.width >= 2 && c.height >= 2 && c.width <= kMaxCellSide && c.height <= kMaxCellSide);
    RC_ASSERT(c.width % 2 == 0 && c.height % 2 == 0);
    RC_ASSERT(c.x >= config.border_px && c.x + c.width <= width - config.border_px);
    RC_ASSERT(c.y >= config.border_px && c.y + c.height <= height - config.border_px);
    if (i % detector.columns()) RC_ASSERT(c.x == detector.cell(i - 1).x + c.width);
  }
}

TEST(Detector, FillsEmptyCellsOnly) {
  std::mt19937 random(5);
  const TestImage image = random_image(752, 480, random);
  Detector detector(752, 480, {});
  auto tracks = std::make_unique<TrackTable>();
  EXPECT_EQ(detector.detect(image.view(), {}, 150, *tracks), 150);
  std::vector<int> in_cell(160);
  for (int i = 0; i < 150; ++i) {
    const int c = (static_cast<int>(tracks->x[i]) - 12) / 44, r = (static_cast<int>(tracks->y[i]) - 12) / 44;
    ++in_cell[static_cast<std::size_t>(r * 16 + c)];
    for (int j = 0; j < i; ++j) {
      ASSERT_GE(std::hypot(tracks->x[i] - tracks->x[j], tracks->y[i] - tracks->y[j]), 20);
    }
  }
  EXPECT_EQ(*std::max_element(in_cell.begin(), in_cell.end()), 1);
  EXPECT_EQ(detector.detect(image.view(), {}, 150, *tracks), 0) << "the table is full";
  tracks->size = 140;
  EXPECT_EQ(detector.detect(image.view(), {}, 150, *tracks), 10);
}

TEST(Detector, KeepsItsDistanceFromWhatIsTaken) {
  std::mt19937 random(5);
  const TestImage image = random_image(752, 480, random);
  Detector detector(752, 480, {});
  std::vector<std::array<float, 2>> taken;
  for (int i = 0; i < 40; ++i)
    taken.push_back({30.F + 17.F * static_cast<float>(i), 20.F + 11.F * static_cast<float>(i)});
  auto tracks = std::make_unique<TrackTable>();
  EXPECT_GT(detector.detect(image.view(), taken, 150, *tracks), 80);
  for (int i = 0; i < tracks->size; ++i)
    for (const auto& [x, y] : taken) ASSERT_GE(std::hypot(tracks->x[i] - x, tracks->y[i] - y), 20);
}

TEST(Detector, StartsElsewhereInEveryImage) {
  std::mt19937 random(6);
  const TestImage image = random_image(752, 480, random);
  TrackerConfig config;
  config.max_features = 1;
  config.cells_per_feature = 160;
  Detector detector(752, 480, config);
  auto tracks = std::make_unique<TrackTable>();
  std::vector<std::pair<float, float>> seen;
  for (int k = 0; k < detector.columns() * detector.rows(); ++k) {
    tracks->size = 0;
    ASSERT_EQ(detector.detect(image.view(), {}, 1, *tracks), 1);
    seen.emplace_back(tracks->x[0], tracks->y[0]);
  }
  std::sort(seen.begin(), seen.end());
  EXPECT_EQ(std::unique(seen.begin(), seen.end()), seen.end()) << "a cell came first twice before all had been";
}

}  // namespace
}  // namespace epiline
