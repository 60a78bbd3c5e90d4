#include "drivers/study/calibrate/board_drawing.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <utility>

#include "pipeline/text/text.h"

#ifdef EPILINE_APRILTAG
extern "C" {
#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>
}
#endif

namespace epiline {

namespace {

#ifdef EPILINE_APRILTAG

/// A tag to draw: lower left corner and side, m; black cells around its bits; turned by half a turn?
struct DrawnTag {
  int id;
  double x, y, side;
  int border;
  bool turned;
};

/// Cells of a tag that are white: one bit each, the first in the highest bit of the code.
std::set<std::pair<int, int>> white_cells(const apriltag_family_t& family, const DrawnTag& tag) {
  std::set<std::pair<int, int>> cells;
  const int last = family.width_at_border - 1;
  for (std::uint32_t i = 0; i < family.nbits; ++i) {
    if ((family.codes[tag.id] >> (family.nbits - 1 - i) & 1) == 0) continue;
    const int wider = tag.border - kUsualBorder;  // than the library's family
    const int x = static_cast<int>(family.bit_x[i]), y = static_cast<int>(family.bit_y[i]);
    cells.emplace((tag.turned ? last - x : x) + wider, (tag.turned ? last - y : y) + wider);
  }
  return cells;
}

/// Row by row from the top.
void add_tag(const apriltag_family_t& family, const DrawnTag& tag, std::vector<BlackBox>& boxes) {
  const auto white = white_cells(family, tag);
  const int cells = family.width_at_border + 2 * (tag.border - kUsualBorder);
  const double cell = tag.side / cells;
  for (int row = 0; row < cells; ++row) {
    int from = -1;
    for (int column = 0; column <= cells; ++column) {
      const bool black = column < cells && white.count({column, row}) == 0;
      if (black && from < 0) from = column;
      if (black || from < 0) continue;
      boxes.push_back({tag.x + from * cell, tag.y + (cells - 1 - row) * cell, (column - from) * cell, cell});
      from = -1;
    }
  }
}

void add_board(const apriltag_family_t& family, const AprilGrid& grid, std::vector<BlackBox>& boxes) {
  for (int tag = 0; tag < grid.tags(); ++tag) {
    const int column = tag % grid.columns, row = tag / grid.columns;
    add_tag(family, {tag, grid.step_m() * column, grid.step_m() * row, grid.tag_m, kKalibrBorder, false}, boxes);
  }
  const double gap = grid.spacing * grid.tag_m;
  for (int row = 0; row <= grid.rows; ++row)
    for (int column = 0; column <= grid.columns; ++column)
      boxes.push_back({grid.step_m() * column - gap, grid.step_m() * row - gap, gap, gap});
}

void add_board(const apriltag_family_t& family, const CharucoBoard& charuco, std::vector<BlackBox>& boxes) {
  const double side = charuco.square_m, margin = (charuco.square_m - charuco.tag_m) / 2;
  const auto below = [&](int row) { return (charuco.rows - 1 - row) * side; };
  for (int row = 0; row < charuco.rows; ++row)
    for (int column = row % 2; column < charuco.columns; column += 2)
      boxes.push_back({column * side, below(row), side, side});
  for (int tag = 0; tag < charuco.tags(); ++tag) {
    const CharucoBoard::Place square = charuco.place_of(tag);
    add_tag(family, {tag, square.column * side + margin, below(square.row) + margin, charuco.tag_m, kUsualBorder, true},
            boxes);
  }
}

#endif

constexpr double kPointsPerMetre = 72 / 0.0254;

/// What is printed below it, for a check with a ruler.
std::string caption(const AprilGrid& grid) {
  return fmt::format("AprilGrid 36h11, {} x {} tags of {:.2f} mm, {:.2f} mm from edge to edge. Print at 100 %.",
                     grid.columns, grid.rows, 1e3 * grid.tag_m, 1e3 * grid.width_m());
}
std::string caption(const CharucoBoard& charuco) {
  return fmt::format(
      "ChArUco AprilTag 36h11, {} x {} squares of {:.2f} mm, tags of {:.2f} mm, {:.2f} mm from edge to edge. Print at "
      "100 %.",
      charuco.columns, charuco.rows, 1e3 * charuco.square_m, 1e3 * charuco.tag_m, 1e3 * charuco.width_m());
}

/// All of the page but its frame, in PDF's words; width and height in points.
struct PageContent {
  Text text;
  double width = 0, height = 0;
};

template <class Kind>
PageContent content_of(const Kind& board, const std::vector<BlackBox>& boxes) {
  constexpr double kLeastMargin_m = 0.008;
  const double margin = std::max(board.margin_m(), kLeastMargin_m);
  PageContent page;
  page.width = kPointsPerMetre * (board.width_m() + 2 * margin);
  page.height = kPointsPerMetre * (board.height_m() + 2 * margin);
  for (const BlackBox& box : boxes) {
    page.text.print("{:.4f} {:.4f} {:.4f} {:.4f} re\n", kPointsPerMetre * (box.x + margin),
                    kPointsPerMetre * (box.y + margin), kPointsPerMetre * box.width, kPointsPerMetre * box.height);
  }
  page.text.print("f\nBT /F1 7 Tf {:.2f} 6 Td ({}) Tj ET\n", kPointsPerMetre * margin, caption(board));
  return page;
}

}  // namespace

Result<std::vector<BlackBox>> black_boxes(const Board& board) {
#ifdef EPILINE_APRILTAG
  std::vector<BlackBox> boxes;
  apriltag_family_t* family = tag36h11_create();
  std::visit([&](const auto& kind) { add_board(*family, kind, boxes); }, board);
  tag36h11_destroy(family);
  return boxes;
#else
  static_cast<void>(board);
  return Error{ErrorKind::kUsage, "", 0, "this program cannot draw boards", "a build with libapriltag-dev installed"};
#endif
}

Result<std::string> board_pdf(const Board& board) {
  const auto boxes = black_boxes(board);
  if (!boxes) return boxes.error();
  const PageContent page = std::visit([&](const auto& kind) { return content_of(kind, *boxes); }, board);
  const std::string& content = page.text;
  std::string pdf = "%PDF-1.4\n";
  std::vector<std::size_t> places;
  const auto add = [&](const std::string& object) {
    places.push_back(pdf.size());
    pdf += fmt::format("{} 0 obj\n{}\nendobj\n", places.size(), object);
  };
  add("<< /Type /Catalog /Pages 2 0 R >>");
  add("<< /Type /Pages /Kids [3 0 R] /Count 1 >>");
  add(
      fmt::format("<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {:.4f} {:.4f}] /Contents 4 0 R /Resources << /Font << "
                  "/F1 5 0 R >> >> >>",
                  page.width, page.height));
  add(fmt::format("<< /Length {} >>\nstream\n{}endstream", content.size(), content));
  add("<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>");
  const std::size_t table = pdf.size();
  pdf += fmt::format("xref\n0 {}\n0000000000 65535 f \n", places.size() + 1);
  for (const std::size_t place : places) pdf += fmt::format("{:010} 00000 n \n", place);
  pdf += fmt::format("trailer\n<< /Size {} /Root 1 0 R >>\nstartxref\n{}\n%%EOF\n", places.size() + 1, table);
  return pdf;
}

}  // namespace epiline
