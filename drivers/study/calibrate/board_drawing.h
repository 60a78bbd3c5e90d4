#pragma once
// A board to print: true to scale, as PDF.
#include <string>
#include <vector>

#include "drivers/study/calibrate/board.h"
#include "platform/error/result.h"

namespace epiline {

/// A black rectangle on the board, m; T as in Board.
struct BlackBox {
  double x, y, width, height;
};

/// Everything black: the tags' cells and the squares between them. Fails if and
/// only if the program was built without libapriltag.
Result<std::vector<BlackBox>> black_boxes(const Board& board);

/// One page around the board with a white margin, a line below that tells its size, for a check with a ruler.
Result<std::string> board_pdf(const Board& board);

}  // namespace epiline
