#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <optional>
#include <string>

#include "drivers/program/cli/commands.h"
#include "drivers/study/calibrate/board_drawing.h"
#include "pipeline/text/table.h"

namespace epiline {

namespace {

struct BoardArguments {
  std::string kind = "aprilgrid";
  std::optional<int> columns, rows;
  std::optional<double> tag_mm, spacing, square_mm;  ///< not given: the kind's own
  std::filesystem::path out;
  Foreign foreign = Foreign::kRefuse;
};

/// 6 x 8 tags of 24 mm, and 7 x 9 squares of 26 mm: they fit on A4.
Result<Board> board_of(const BoardArguments& a) {
  const auto unfit = [](const char* option, const char* kind) {
    return Error{ErrorKind::kUsage, "", 0, fmt::format("{} with --kind {}", option, kind),
                 "--spacing for an aprilgrid, --square-mm for a charuco"};
  };
  if (a.kind == "aprilgrid") {
    if (a.square_mm) return unfit("--square-mm", "aprilgrid");
    return Board(
        AprilGrid{a.columns.value_or(6), a.rows.value_or(8), 1e-3 * a.tag_mm.value_or(24), a.spacing.value_or(0.3)});
  }
  if (a.spacing) return unfit("--spacing", "charuco");
  constexpr double kTagShare = 19.0 / 26, kMostShare = 0.9;  // of a square
  const double square_mm = a.square_mm.value_or(26),
               tag_mm = a.tag_mm.value_or(std::round(10 * kTagShare * square_mm) / 10);
  const CharucoBoard board{a.columns.value_or(7), a.rows.value_or(9), square_mm / 1000, tag_mm / 1000};
  if (board.columns < 3 || board.rows < 3)
    return Error{ErrorKind::kUsage, "", 0, fmt::format("{} x {} squares", board.columns, board.rows), "at least 3 x 3"};
  if (tag_mm > kMostShare * square_mm) {
    return Error{ErrorKind::kUsage, "", 0, fmt::format("tags of {} mm in squares of {} mm", tag_mm, square_mm),
                 "tags of at most nine tenths of a square: they need white around them"};
  }
  return Board(board);
}

std::string text_of(const AprilGrid& grid) {
  return fmt::format("{} x {} tags, {:.1f} x {:.1f} mm", grid.columns, grid.rows, 1e3 * grid.width_m(),
                     1e3 * grid.height_m());
}
std::string text_of(const CharucoBoard& board) {
  return fmt::format("{} x {} squares, {:.1f} x {:.1f} mm", board.columns, board.rows, 1e3 * board.width_m(),
                     1e3 * board.height_m());
}

int write_board(BoardArguments& arguments) {
  const auto board = board_of(arguments);
  if (!board) return report(board.error());
  if (tags_of(*board) > kTagsOfFamily) {
    return report(
        {ErrorKind::kUsage, "", 0, fmt::format("{} tags", tags_of(*board)), fmt::format("at most {}", kTagsOfFamily)});
  }
  const auto pdf = board_pdf(*board);
  if (!pdf) return report(pdf.error());
  std::filesystem::path description = arguments.out;
  description.replace_extension(".yaml");
  const std::filesystem::path place = arguments.out.has_parent_path() ? arguments.out.parent_path() : ".";
  const auto folder =
      claim(place, {arguments.out.filename().string(), description.filename().string()}, arguments.foreign);
  if (!folder) return report(folder.error());
  if (const Status s = make_folder(place); !s) return report(s.error());
  if (const Status s = write_text(arguments.out, *pdf); !s) return report(s.error());
  if (const Status s = write_text(description, board_yaml(*board)); !s) return report(s.error());
  fmt::print("board       {}: {}; print it at 100 %, glue it to something flat\n", arguments.out.string(),
             std::visit([](const auto& kind) { return text_of(kind); }, *board));
  const bool is_grid = std::holds_alternative<AprilGrid>(*board);
  fmt::print("description {}: measure a {} on the paper, and correct {}\n", description.string(),
             is_grid ? "tag" : "square", is_grid ? "tagSize" : "squareSize");
  return kExitDone;
}

}  // namespace

void add_board(CLI::App& app, int& exit_code) {
  const auto [command, arguments] = add_command(app, exit_code, kFly, "board",
                                                "Write a calibration board to print, and its description", write_board);
  command->add_option("--out", arguments->out, "PDF file; the description goes to the same name with .yaml")
      ->required();
  add_force(*command, arguments->foreign);
  command
      ->add_option("--kind", arguments->kind,
                   "aprilgrid: tags in rows, as Kalibr's; charuco: a chessboard with tags, as OpenCV's with "
                   "DICT_APRILTAG_36h11")
      ->check(CLI::IsMember({"aprilgrid", "charuco"}))
      ->capture_default_str();
  command->add_option("--columns", arguments->columns, "tags or squares side by side (default 6 tags, 7 squares)")
      ->check(CLI::Range(1, 30));
  command->add_option("--rows", arguments->rows, "tags or squares above each other (default 8 tags, 9 squares)")
      ->check(CLI::Range(1, 30));
  command->add_option("--tag-mm", arguments->tag_mm, "side of a tag (default 24, in a charuco 19/26 of a square)")
      ->check(CLI::Range(5.0, 1000.0));
  command
      ->add_option("--spacing", arguments->spacing, "aprilgrid: between tags, as a share of their side (default 0.3)")
      ->check(CLI::Range(0.1, 1.0));
  command->add_option("--square-mm", arguments->square_mm, "charuco: side of a square (default 26)")
      ->check(CLI::Range(6.0, 1000.0));
}

}  // namespace epiline
