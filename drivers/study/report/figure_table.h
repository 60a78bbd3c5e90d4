#pragma once
// A table of figures, once described and then written as text and as HTML.
#include <string>
#include <vector>

namespace epiline {

struct TableCell {
  std::string text;
  bool best = false;  ///< bold; in text with a star
  bool bad = false;   ///< red
  std::string link;   ///< where the text leads to in HTML
};

/// A heading over some columns.
struct ColumnGroup {
  std::string name;
  std::size_t columns = 1;
};

struct FigureTable {
  std::string title, note;
  std::vector<ColumnGroup> groups;   ///< empty, or covering all columns
  std::vector<std::string> columns;  ///< one name each
  std::vector<bool> left;            ///< aligned to the left; columns beyond its end are not
  std::vector<std::vector<TableCell>> rows;
  std::size_t summary_rows = 0;  ///< that many at the end stand under a line
};

std::string to_text(const FigureTable& table);

/// Without title and note: those belong to the card around it.
std::string to_html(const FigureTable& table);

/// Marks the smallest of the cells' values as best; does nothing below two values. `values` runs along with `cells`;
/// not finite: no value.
void mark_least(const std::vector<double>& values, std::vector<TableCell*> cells);

}  // namespace epiline
