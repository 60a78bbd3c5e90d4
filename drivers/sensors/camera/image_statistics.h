#pragma once
// What a small sample of an image says of its exposure.
#include <array>
#include <cstddef>
#include <cstdint>

namespace epiline {

/// Of about 1500 places of an image: the brightest of three neighbouring pixels, and their greatest difference.
struct ImageStatistics {
  static constexpr std::size_t kLevels = 32, kSlopes = 16;
  static constexpr int kLevelWidth = 8, kSlopeWidth = 4;  ///< grey values in a bin; the last slope bin is open
  static constexpr int kDark = 16, kClipped = 250;

  std::array<std::array<std::uint16_t, kSlopes>, kLevels> places{};
  int count = 0;
  double mean = 0;
  double dark_share = 0;     ///< of places darker than kDark
  double clipped_share = 0;  ///< of places not darker than kClipped
};

/// Bounded: it looks at a fixed number of places whatever the size. Images smaller than 8x8 have none.
ImageStatistics statistics_of(const std::uint8_t* data, int width, int height, int stride) noexcept;

}  // namespace epiline
