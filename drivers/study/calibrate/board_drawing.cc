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

/// Cells of a tag that are white: one bit each, the first in the highest bit of the code.
std::set<std::pair<int, int>> white_cells(const apriltag_family_t& family, int tag) {
  std::set<std::pair<int, int>> cells;
  for (std::uint32_t i = 0; i < family.nbits; ++i) {
    if ((family.codes[tag] >> (family.nbits - 1 - i) & 1) == 0) continue;
    const int border = 1;  // of the library's family
    cells.emplace(static_cast<int>(family.bit_x[i]) - border + kKalibrBorder,
                  static_cast<int>(family.bit_y[i]) - border + kKalibrBorder);
  }
  return cells;
}

/// One tag, row by row from the top.
void add_tag(const apriltag_family_t& family, int tag, const AprilGrid& grid, std::vector<BlackBox>& boxes) {
  const auto white = white_cells(family, tag);
  const int cells = family.width_at_border - 2 + 2 * kKalibrBorder;
  const double cell = grid.tag_m / cells;
  const int tag_column = tag % grid.columns, tag_row = tag / grid.columns;
  const double x = grid.step_m() * tag_column, y = grid.step_m() * tag_row;
  for (int row = 0; row < cells; ++row) {
    int from = -1;
    for (int column = 0; column <= cells; ++column) {
      const bool black = column < cells && white.count({column, row}) == 0;
      if (black && from < 0) from = column;
      if (black || from < 0) continue;
      boxes.push_back({x + from * cell, y + (cells - 1 - row) * cell, (column - from) * cell, cell});
      from = -1;
    }
  }
}

#endif

constexpr double kPointsPerMetre = 72 / 0.0254;

}  // namespace

Result<std::vector<BlackBox>> black_boxes(const AprilGrid& grid) {
#ifdef EPILINE_APRILTAG
  std::vector<BlackBox> boxes;
  apriltag_family_t* family = tag36h11_create();
  for (int tag = 0; tag < grid.tags(); ++tag) add_tag(*family, tag, grid, boxes);
  tag36h11_destroy(family);
  const double gap = grid.spacing * grid.tag_m;
  for (int row = 0; row <= grid.rows; ++row)
    for (int column = 0; column <= grid.columns; ++column)
      boxes.push_back({grid.step_m() * column - gap, grid.step_m() * row - gap, gap, gap});
  return boxes;
#else
  static_cast<void>(grid);
  return Error{ErrorKind::kUsage, "", 0, "this program cannot draw boards", "a build with libapriltag-dev installed"};
#endif
}

Result<std::string> board_pdf(const AprilGrid& grid) {
  const auto boxes = black_boxes(grid);
  if (!boxes) return boxes.error();
  const double margin = std::max(2 * grid.spacing * grid.tag_m, 0.008);
  const double width = kPointsPerMetre * (grid.width_m() + 2 * margin),
               height = kPointsPerMetre * (grid.height_m() + 2 * margin);
  Text page;
  for (const BlackBox& box : *boxes) {
    page.print("{:.4f} {:.4f} {:.4f} {:.4f} re\n", kPointsPerMetre * (box.x + margin),
               kPointsPerMetre * (box.y + margin), kPointsPerMetre * box.width, kPointsPerMetre * box.height);
  }
  page.print(
      "f\nBT /F1 7 Tf {:.2f} 6 Td (AprilGrid 36h11, {} x {} tags of {:.2f} mm, {:.2f} mm from edge to edge. Print at "
      "100 %.) Tj ET\n",
      kPointsPerMetre * margin, grid.columns, grid.rows, 1e3 * grid.tag_m, 1e3 * grid.width_m());
  const std::string& content = page;
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
                  width, height));
  add(fmt::format("<< /Length {} >>\nstream\n{}endstream", content.size(), content));
  add("<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>");
  const std::size_t table = pdf.size();
  pdf += fmt::format("xref\n0 {}\n0000000000 65535 f \n", places.size() + 1);
  for (const std::size_t place : places) pdf += fmt::format("{:010} 00000 n \n", place);
  pdf += fmt::format("trailer\n<< /Size {} /Root 1 0 R >>\nstartxref\n{}\n%%EOF\n", places.size() + 1, table);
  return pdf;
}

}  // namespace epiline
