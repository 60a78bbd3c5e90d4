#include "drivers/study/calibrate/april_detector.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "drivers/study/calibrate/corner_refine.h"

#ifdef EPILINE_APRILTAG
extern "C" {
#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>
}
#endif

namespace epiline {

#ifndef EPILINE_APRILTAG

struct AprilDetector::Parts {};
Result<AprilDetector> AprilDetector::create(const AprilGrid&) {
  return Error{ErrorKind::kUsage, "", 0, "this program cannot find boards in images",
               "a build with libapriltag-dev installed, or corners (tracks.csv and target.csv)"};
}
std::vector<Corner> AprilDetector::find(const GreyPixels&) { return {}; }

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

/// Each pixel the brightest of its neighbourhood: tags and the black squares that touch their corners come apart, which
/// the library needs to see a tag as one dark region.
void part_dark_regions(const GreyPixels& image, GreyImage& parted) {
  parted.resize(image.width, image.height);
  for (int y = 0; y < image.height; ++y) {
    const std::uint8_t *above = image.row(std::max(y - 1, 0)), *here = image.row(y),
                       *below = image.row(std::min(y + 1, image.height - 1));
    std::uint8_t* out = parted.row(y);
    for (int x = 0; x < image.width; ++x) {
      const int left = std::max(x - 1, 0), right = std::min(x + 1, image.width - 1);
      out[x] = std::max(
          {here[x], above[x], below[x], here[left], here[right], above[left], above[right], below[left], below[right]});
    }
  }
}

}  // namespace

struct AprilDetector::Parts {
  explicit Parts(const AprilGrid& the_grid)
      : grid(the_grid),
        target(the_grid.target()),
        narrow(tag36h11_create()),
        wide(tag36h11_create()),
        detector(apriltag_detector_create()) {
    constexpr int kBitsOff = 1, kThreads = 2;
    widen_border(*wide);
    apriltag_detector_add_family_bits(detector, narrow, kBitsOff);
    apriltag_detector_add_family_bits(detector, wide, kBitsOff);
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

  AprilGrid grid;
  Target target;
  apriltag_family_t *narrow, *wide;
  apriltag_detector_t* detector;
  GreyImage parted;
};

Result<AprilDetector> AprilDetector::create(const AprilGrid& grid) {
  return AprilDetector(std::make_unique<Parts>(grid));
}

std::vector<Corner> AprilDetector::find(const GreyPixels& image) {
  constexpr float kLeastMargin = 30;
  part_dark_regions(image, parts_->parted);
  image_u8_t view = {image.width, image.height, image.width, parts_->parted.pixels.data()};
  zarray_t* found = apriltag_detector_detect(parts_->detector, &view);
  std::map<int, const apriltag_detection_t*> tags;
  int of_wide = 0, of_narrow = 0;
  for (int i = 0; i < zarray_size(found); ++i) {
    apriltag_detection_t* tag = nullptr;
    zarray_get(found, i, &tag);
    if (tag->decision_margin >= kLeastMargin) ++(tag->family == parts_->wide ? of_wide : of_narrow);
  }
  const apriltag_family_t* family = of_wide >= of_narrow ? parts_->wide : parts_->narrow;
  std::vector<int> doubled;
  for (int i = 0; i < zarray_size(found); ++i) {
    apriltag_detection_t* tag = nullptr;
    zarray_get(found, i, &tag);
    if (tag->family != family || tag->decision_margin < kLeastMargin || tag->id >= parts_->grid.tags()) continue;
    if (!tags.emplace(tag->id, tag).second) doubled.push_back(tag->id);
  }
  for (const int id : doubled) tags.erase(id);
  std::vector<Corner> corners;
  for (const auto& [id, tag] : tags) {
    std::array<Vec2, 4> px;
    double shortest = 1e9;
    for (std::size_t k = 0; k < 4; ++k) {
      px[k] = {tag->p[k][0] - 0.5, tag->p[k][1] - 0.5};  // there, (0, 0) is the image's outer corner
      const std::size_t next = (k + 1) % 4;
      shortest = std::min(shortest, std::hypot(tag->p[k][0] - tag->p[next][0], tag->p[k][1] - tag->p[next][1]));
    }
    // as wide as the black squares at the tag's corners, so that no other edge is seen
    const double cell = shortest / family->width_at_border;
    const int half = std::clamp(static_cast<int>(1.5 * cell), 2, 8);
    for (std::size_t k = 0; k < 4; ++k) {
      if (!refine_corner(image, half, px[k])) continue;
      const auto corner = static_cast<std::uint32_t>(4 * id + static_cast<int>(k));
      corners.push_back({corner, parts_->target.at(corner), px[k]});
    }
  }
  apriltag_detections_destroy(found);
  return corners;
}

#endif

AprilDetector::AprilDetector(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
AprilDetector::AprilDetector(AprilDetector&&) noexcept = default;
AprilDetector& AprilDetector::operator=(AprilDetector&&) noexcept = default;
AprilDetector::~AprilDetector() = default;

}  // namespace epiline
