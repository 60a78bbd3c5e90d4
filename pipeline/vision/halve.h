#pragma once
#include <cstdint>

#include "pipeline/vision/image_view.h"

namespace epiline {

inline constexpr int kMinHalvedWidth = 32;  ///< of the result; the last vector of a row overlaps the one before

/// Every pixel of the result is the mean of 2x2 pixels, rounded once: (a + b + c + d + 2) / 4. An odd last row or
/// column of `in` is left out. `out` has in.height / 2 rows of in.width / 2 >= kMinHalvedWidth pixels, `out_stride`
/// bytes apart.
void halve(const ImageView& in, std::uint8_t* out, int out_stride) noexcept;

}  // namespace epiline
