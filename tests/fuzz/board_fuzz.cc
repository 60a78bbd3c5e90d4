// Any bytes as the description of a calibration board, in Kalibr's words and as a table of corners: read, with a board
// that can be one, or refused with the file's name. Never a crash.
#include <cstdint>
#include <string>

#include "drivers/study/calibrate/board.h"
#include "drivers/study/calibrate/corner_views.h"
#include "tests/fuzz/scratch_folder.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const ScratchFolder folder("board_fuzz");
  const auto board = epiline::read_board(folder.write("board.yaml", text_of(data, size)));
  if (board) {
    const auto tags = epiline::tags_of(*board);
    expect(tags > 0 && tags <= epiline::kTagsOfFamily);
    const auto* grid = std::get_if<epiline::AprilGrid>(&*board);
    expect(grid == nullptr || (grid->tag_m > 0 && grid->spacing > 0 && grid->target().size() == 4U * tags));
  } else {
    expect(board.error().text().find("board.yaml") != std::string::npos);
  }
  const auto target = epiline::read_target(folder.write("target.csv", text_of(data, size)));
  if (target) {
    expect(target->size() >= 4);
    for (const auto& corner : *target) expect(corner.second.allFinite());
  } else {
    expect(target.error().text().find("target.csv") != std::string::npos);
  }
  return 0;
}
