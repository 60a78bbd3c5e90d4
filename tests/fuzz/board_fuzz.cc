// Any bytes as the description of a calibration board, in Kalibr's words and as a table of corners: read, with a board
// that can be one, or refused with the file's name. Never a crash.
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "drivers/study/calibrate/april_grid.h"
#include "drivers/study/calibrate/corner_views.h"
#include "tests/fuzz/scratch_folder.h"

namespace {

std::filesystem::path write(const char* name, const std::uint8_t* data, std::size_t size) {
  static const ScratchFolder folder("board_fuzz");
  const std::filesystem::path path = folder.path() / name;
  std::ofstream(path, std::ios::binary).write(reinterpret_cast<const char*>(data), static_cast<std::streamsize>(size));
  return path;
}

void expect(bool holds) {
  if (!holds) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto grid = epiline::read_april_grid(write("board.yaml", data, size));
  if (grid) {
    expect(grid->tags() > 0 && grid->tags() <= epiline::kTagsOfFamily && grid->tag_m > 0 && grid->spacing > 0);
    expect(grid->target().size() == 4 * static_cast<std::size_t>(grid->tags()));
  } else {
    expect(grid.error().text().find("board.yaml") != std::string::npos);
  }
  const auto target = epiline::read_target(write("target.csv", data, size));
  if (target) {
    expect(target->size() >= 4);
    for (const auto& corner : *target) expect(corner.second.allFinite());
  } else {
    expect(target.error().text().find("target.csv") != std::string::npos);
  }
  return 0;
}
