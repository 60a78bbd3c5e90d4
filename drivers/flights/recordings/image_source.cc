#include "drivers/flights/recordings/image_source.h"

namespace epiline {

/// Cameras of 10 or 12 bits leave the upper ones of 16 empty. Five images tell, lest one of a dark place decide.
int ImageSource::find_used_bits() {
  constexpr std::size_t kLooks = 5;
  GreyImage image;
  unsigned highest = 0;
  for (std::size_t n = 0; n < kLooks; ++n) {
    if (decode(n * (count() - 1) / (kLooks - 1), image) && image.highest == 0) return 16;
    highest = std::max(highest, image.highest);
  }
  for (const int bits : {8, 10, 12, 14})
    if (highest > 0 && highest < 1U << bits) return bits;
  return 16;
}

Status ImageSource::read(std::size_t index, GreyImage& grey) {
  if (used_bits_ == 0) used_bits_ = find_used_bits();
  grey.used_bits = used_bits_;
  return decode(index, grey);
}

}  // namespace epiline
