#include "drivers/sensors/camera/image_statistics.h"

#include <algorithm>

namespace epiline {

namespace {

constexpr int kColumns = 48, kRows = 32;
constexpr int kNear = 2;  // pixels between neighbours: a sharp edge is about so wide

}  // namespace

ImageStatistics statistics_of(const std::uint8_t* data, int width, int height, int stride) noexcept {
  ImageStatistics result;
  if (width < 8 || height < 8) return result;
  std::int64_t sum = 0;
  int dark = 0, clipped = 0;
  for (int r = 0; r < kRows; ++r) {
    const int y = (2 * r + 1) * (height - kNear) / (2 * kRows);
    const int shift = r * 29 % 48;  // rows begin at different places: patterns of the scene do not fall in step
    for (int c = 0; c < kColumns; ++c) {
      const int x = (48 * c + shift) * (width - kNear) / (48 * kColumns);
      const std::uint8_t* at = data + static_cast<std::ptrdiff_t>(y) * stride + x;
      const int here = at[0], right = at[kNear], below = at[static_cast<std::ptrdiff_t>(kNear) * stride];
      const int brightest = std::max({here, right, below});
      const int slope = std::max(std::abs(right - here), std::abs(below - here)) / ImageStatistics::kSlopeWidth;
      const auto slope_bin = std::min(static_cast<std::size_t>(slope), ImageStatistics::kSlopes - 1);
      ++result.places[static_cast<std::size_t>(brightest / ImageStatistics::kLevelWidth)][slope_bin];
      sum += here;
      dark += brightest < ImageStatistics::kDark ? 1 : 0;
      clipped += brightest >= ImageStatistics::kClipped ? 1 : 0;
    }
  }
  result.count = kRows * kColumns;
  result.mean = static_cast<double>(sum) / result.count;
  result.dark_share = static_cast<double>(dark) / result.count;
  result.clipped_share = static_cast<double>(clipped) / result.count;
  return result;
}

}  // namespace epiline
