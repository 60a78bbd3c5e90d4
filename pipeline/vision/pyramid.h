#pragma once
#include <vector>

#include "pipeline/vision/image_view.h"

namespace epiline {

/// An image and its halvings. Level 0 stays in the caller's memory; the others are owned, rows padded to 64 bytes.
class Pyramid {
 public:
  /// At most `levels` levels (1 to kMaxLevels) of an image of this size; none but level 0 has a side below 32 px.
  Pyramid(int width, int height, int levels);

  /// `image` must have the size given to the constructor, and stay valid as long as view() is used.
  void build(const ImageView& image) noexcept;

  const PyramidView& view() const { return view_; }

 private:
  struct alignas(64) Line {
    std::uint8_t bytes[64];
  };
  std::vector<Line> memory_;
  std::uint8_t* pixels_[kMaxLevels] = {};
  PyramidView view_;
};

}  // namespace epiline
