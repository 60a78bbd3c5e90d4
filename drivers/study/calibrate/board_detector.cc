#include "drivers/study/calibrate/board_detector.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#ifdef EPILINE_APRILTAG
extern "C" {
#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>
}
#endif

namespace epiline {

namespace {

double grey_at(const GreyPixels& image, double x, double y) {
  const int column = static_cast<int>(x), row = static_cast<int>(y);
  const double u = x - column, v = y - row;
  const std::uint8_t *above = image.row(row) + column, *below = image.row(row + 1) + column;
  return (1 - v) * ((1 - u) * above[0] + u * above[1]) + v * ((1 - u) * below[0] + u * below[1]);
}

}  // namespace

bool refine_corner(const GreyPixels& image, int half, Vec2& px) {
  constexpr int kMost = 15;
  constexpr double kSettled_px = 0.003;
  const Vec2 start = px;
  Vec2 centre = px;
  for (int i = 0; i < kMost; ++i) {
    if (!(centre.x() - half - 1 >= 0 && centre.y() - half - 1 >= 0 && centre.x() + half + 2 < image.width &&
          centre.y() + half + 2 < image.height))
      return false;
    Eigen::Matrix2d A = Eigen::Matrix2d::Zero();
    Vec2 b = Vec2::Zero();
    for (int dy = -half; dy <= half; ++dy) {
      for (int dx = -half; dx <= half; ++dx) {
        const double x = centre.x() + dx, y = centre.y() + dy;
        const Vec2 gradient(grey_at(image, x + 1, y) - grey_at(image, x - 1, y),
                            grey_at(image, x, y + 1) - grey_at(image, x, y - 1));
        const double share = 1.0 / (half * half);
        const double weight = std::exp(-share * (dx * dx + dy * dy));
        const Eigen::Matrix2d G = weight * gradient * gradient.transpose();
        A += G;
        b += G * Vec2(dx, dy);
      }
    }
    // Of A's two eigenvalues the lesser is more than kCorner times the larger: an edge has only one. With the ratio r
    // of the two, det(A) / tr(A)^2 = r / (1 + r)^2, which grows with r.
    constexpr double kCorner = 0.02;
    const double trace = A.trace();
    if (!(A.determinant() > kCorner / ((1 + kCorner) * (1 + kCorner)) * trace * trace)) return false;
    const Vec2 step = A.inverse() * b;
    centre += step;
    if (!((centre - start).norm() < half)) return false;
    if (step.norm() < kSettled_px) break;
  }
  px = centre;
  return true;
}

#ifndef EPILINE_APRILTAG

struct BoardDetector::Parts {};
Result<BoardDetector> BoardDetector::create(const Board&) {
  return Error{ErrorKind::kUsage, "", 0, "this program cannot find boards in images",
               "a build with libapriltag-dev installed, or corners (tracks.csv and target.csv)"};
}
std::vector<BoardCorner> BoardDetector::find(const GreyPixels&) { return {}; }

#else

namespace {

/// The library's family for a border of one cell, changed to one of two: Kalibr's.
void widen_border(apriltag_family_t& family) {
  family.width_at_border += 2;
  family.total_width += 2;
  for (std::uint32_t i = 0; i < family.nbits; ++i) {
    ++family.bit_x[i];
    ++family.bit_y[i];
  }
}

/// Each pixel the brightest of itself and its neighbours to the right, below and between: tags and the black squares
/// that touch their corners come apart, which the library needs to see a tag as one dark region. A cell loses one pixel
/// only. What is dark moves by half a pixel to the upper left.
void part_dark_regions(const GreyPixels& image, GreyImage& parted) {
  parted.resize(image.width, image.height);
  for (int y = 0; y < image.height; ++y) {
    const std::uint8_t *here = image.row(y), *below = image.row(std::min(y + 1, image.height - 1));
    std::uint8_t* out = parted.row(y);
    for (int x = 0; x < image.width; ++x) {
      const int right = std::min(x + 1, image.width - 1);
      out[x] = std::max({here[x], here[right], below[x], below[right]});
    }
  }
}

/// A tag of the board in an image.
struct TagView {
  int id = 0;
  int cells = 0;              ///< on a side, with the black border
  std::array<Vec2, 4> px;     ///< lower left, lower right, upper right, upper left
  Mat3 H = Mat3::Identity();  ///< from the tag's plane, its border from -1 to 1, y down, to pixels
  double side_px() const {
    double shortest = 1e9;
    for (std::size_t k = 0; k < 4; ++k) shortest = std::min(shortest, (px[k] - px[(k + 1) % 4]).norm());
    return shortest;
  }
  Vec2 at(double x, double y) const { return (H * Vec3(x, y, 1)).hnormalized(); }
};

TagView view_of(const apriltag_detection_t& tag) {
  // There, (0, 0) is the image's outer corner: half a pixel to the lower right, as much as part_dark_regions() took.
  TagView view;
  view.id = tag.id;
  view.cells = tag.family->width_at_border;
  for (std::size_t k = 0; k < 4; ++k) view.px[k] = {tag.p[k][0], tag.p[k][1]};
  for (unsigned row = 0; row < 3; ++row)
    for (unsigned column = 0; column < 3; ++column) view.H(row, column) = MATD_EL(tag.H, row, column);
  return view;
}

}  // namespace

struct BoardDetector::Parts {
  explicit Parts(const Board& the_board)
      : board(the_board),
        target(target_of(the_board)),
        narrow(tag36h11_create()),
        wide(tag36h11_create()),
        detector(apriltag_detector_create()) {
    constexpr int kBitsOff = 1, kThreads = 2;
    widen_border(*wide);
    apriltag_detector_add_family_bits(detector, narrow, kBitsOff);
    if (std::holds_alternative<AprilGrid>(board)) apriltag_detector_add_family_bits(detector, wide, kBitsOff);
    detector->quad_decimate = 1;
    detector->nthreads = kThreads;
  }
  ~Parts() {
    apriltag_detector_destroy(detector);
    tag36h11_destroy(narrow);
    tag36h11_destroy(wide);
  }
  Parts(const Parts&) = delete;
  Parts& operator=(const Parts&) = delete;

  std::vector<TagView> read_tags(const GreyPixels& image);
  std::vector<BoardCorner> corners_at(const GreyPixels& image, const AprilGrid& grid,
                                      const std::vector<TagView>& tags) const;
  std::vector<BoardCorner> corners_at(const GreyPixels& image, const CharucoBoard& charuco,
                                      const std::vector<TagView>& tags) const;

  Board board;
  Target target;
  apriltag_family_t *narrow, *wide;
  apriltag_detector_t* detector;
  GreyImage parted;
};

std::vector<TagView> BoardDetector::Parts::read_tags(const GreyPixels& image) {
  constexpr float kLeastMargin = 30;
  part_dark_regions(image, parted);
  image_u8_t view = {image.width, image.height, image.width, parted.pixels.data()};
  zarray_t* found = apriltag_detector_detect(detector, &view);
  using Detections = std::vector<const apriltag_detection_t*>;
  Detections clear;
  for (int i = 0; i < zarray_size(found); ++i) {
    apriltag_detection_t* tag = nullptr;
    zarray_get(found, i, &tag);
    if (tag->decision_margin >= kLeastMargin) clear.push_back(tag);
  }
  const auto of_wide = std::count_if(clear.begin(), clear.end(), [&](const auto* tag) { return tag->family == wide; });
  const apriltag_family_t* family = 2 * of_wide >= static_cast<std::ptrdiff_t>(clear.size()) ? wide : narrow;
  std::map<int, Detections> tags;
  for (const auto* tag : clear)
    if (tag->family == family && tag->id < tags_of(board)) tags[tag->id].push_back(tag);
  std::vector<TagView> views;
  for (const auto& [id, seen] : tags)
    if (seen.size() == 1) views.push_back(view_of(*seen.front()));
  apriltag_detections_destroy(found);
  return views;
}

/// The corners of the tags themselves.
std::vector<BoardCorner> BoardDetector::Parts::corners_at(const GreyPixels& image, const AprilGrid&,
                                                          const std::vector<TagView>& tags) const {
  std::vector<BoardCorner> corners;
  for (const TagView& tag : tags) {
    // as wide as the black squares at the tag's corners, so that no other edge is seen
    const int half = std::clamp(static_cast<int>(1.5 * tag.side_px() / tag.cells), 2, 8);
    for (std::size_t k = 0; k < 4; ++k) {
      Vec2 px = tag.px[k];
      if (!refine_corner(image, half, px)) continue;
      const auto corner = static_cast<std::uint32_t>(4 * tag.id + static_cast<int>(k));
      corners.push_back({corner, target.at(corner), px});
    }
  }
  return corners;
}

/// The corners of the chessboard around the tags: each begins where the tags beside it expect it.
std::vector<BoardCorner> BoardDetector::Parts::corners_at(const GreyPixels& image, const CharucoBoard& charuco,
                                                          const std::vector<TagView>& tags) const {
  struct Expected {
    Vec2 sum = Vec2::Zero(), first = Vec2::Zero();
    int tags = 0, half = 8;
    bool agree = true;
  };
  const double reach = charuco.square_m / charuco.tag_m;
  std::map<std::uint32_t, Expected> expected;
  for (const TagView& tag : tags) {
    // up to the tag's border, which must not be seen
    const int half = std::clamp(static_cast<int>((reach - 1) / 2 * tag.side_px()), 2, 8);
    const CharucoBoard::Place square = charuco.place_of(tag.id);
    for (const int down : {0, 1}) {
      for (const int right : {0, 1}) {
        const int row = square.row + down, column = square.column + right;
        if (row < 1 || column < 1 || row >= charuco.rows || column >= charuco.columns) continue;
        const Vec2 px = tag.at(right ? -reach : reach, down ? -reach : reach);  // OpenCV's tags stand on their heads
        Expected& corner = expected[static_cast<std::uint32_t>((row - 1) * (charuco.columns - 1) + column - 1)];
        if (corner.tags++ == 0) corner.first = px;
        corner.agree = corner.agree && (px - corner.first).norm() < half;
        corner.sum += px;
        corner.half = std::min(corner.half, half);
      }
    }
  }
  std::vector<BoardCorner> corners;
  for (const auto& [id, corner] : expected) {
    Vec2 px = corner.sum / corner.tags;
    if (corner.agree && refine_corner(image, corner.half, px)) corners.push_back({id, target.at(id), px});
  }
  return corners;
}

Result<BoardDetector> BoardDetector::create(const Board& board) {
  return BoardDetector(std::make_unique<Parts>(board));
}

std::vector<BoardCorner> BoardDetector::find(const GreyPixels& image) {
  const std::vector<TagView> tags = parts_->read_tags(image);
  return std::visit([&](const auto& board) { return parts_->corners_at(image, board, tags); }, parts_->board);
}

#endif

BoardDetector::BoardDetector(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
BoardDetector::BoardDetector(BoardDetector&&) noexcept = default;
BoardDetector& BoardDetector::operator=(BoardDetector&&) noexcept = default;
BoardDetector::~BoardDetector() = default;

}  // namespace epiline
