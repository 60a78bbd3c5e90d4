#pragma once
// Finds a board's corners in images, with libapriltag and a sub-pixel step of our own.
#include <memory>
#include <vector>

#include "drivers/flights/recordings/grey_image.h"
#include "drivers/study/calibrate/board.h"

namespace epiline {

class BoardDetector {
 public:
  /// Fails if and only if the program was built without libapriltag.
  static Result<BoardDetector> create(const Board& board);
  BoardDetector(BoardDetector&&) noexcept;
  BoardDetector& operator=(BoardDetector&&) noexcept;
  ~BoardDetector();

  /// The corners at all tags of the board that are read without doubt, in the order of their ids.
  std::vector<BoardCorner> find(const GreyPixels& image);

 private:
  struct Parts;
  explicit BoardDetector(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

/// Moves `px` to the corner nearby to which the image's gradients point at right angles (Forstner 1987): where two
/// edges meet, also four. `half`: of the window, px. False, with `px` as it was, where the window leaves the image, has
/// no corner, or the corner is not inside it.
bool refine_corner(const GreyPixels& image, int half, Vec2& px);

}  // namespace epiline
