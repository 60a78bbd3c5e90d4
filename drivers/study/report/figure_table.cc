#include "drivers/study/report/figure_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "drivers/study/report/svg_plot.h"

namespace epiline {

namespace {

/// Characters, not bytes.
std::size_t width_of(const std::string& text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; }));
}

std::string padded(const std::string& text, std::size_t width, bool left) {
  const std::string blanks(width - std::min(width, width_of(text)), ' ');
  return left ? text + blanks : blanks + text;
}

bool is_left(const FigureTable& table, std::size_t column) { return column < table.left.size() && table.left[column]; }

std::string shown(const TableCell& cell) { return cell.text + (cell.best ? "*" : ""); }

std::vector<std::size_t> widths_of(const FigureTable& table) {
  std::vector<std::size_t> widths;
  for (const std::string& name : table.columns) widths.push_back(width_of(name));
  for (const auto& row : table.rows) {
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], width_of(shown(row[i])));
  }
  std::size_t first = 0;
  for (const ColumnGroup& group : table.groups) {  // a long heading widens its last column
    std::size_t width = 2 * (group.columns - 1);
    for (std::size_t i = 0; i < group.columns; ++i) width += widths[first + i];
    if (width_of(group.name) > width) widths[first + group.columns - 1] += width_of(group.name) - width;
    first += group.columns;
  }
  return widths;
}

std::string trimmed(std::string line) {
  line.erase(line.find_last_not_of(' ') + 1);
  return line + "\n";
}

}  // namespace

std::string to_text(const FigureTable& table) {
  constexpr const char* kGap = "  ";
  const std::vector<std::size_t> widths = widths_of(table);
  std::string text = table.title + "\n" + (table.note.empty() ? "" : table.note + "\n"), line;
  std::size_t first = 0, total = 0;
  for (const ColumnGroup& group : table.groups) {
    std::size_t width = 2 * (group.columns - 1);
    for (std::size_t i = 0; i < group.columns; ++i) width += widths[first + i];
    line += (first > 0 ? kGap : "") + padded(group.name, width, is_left(table, first));
    first += group.columns;
  }
  if (!line.empty()) text += trimmed(line);
  line.clear();
  for (std::size_t i = 0; i < widths.size(); ++i) {
    line += (i > 0 ? kGap : "") + padded(table.columns[i], widths[i], is_left(table, i));
    total += widths[i] + (i > 0 ? 2 : 0);
  }
  text += trimmed(line) + std::string(total, '-') + "\n";
  for (std::size_t r = 0; r < table.rows.size(); ++r) {
    if (table.summary_rows > 0 && r == table.rows.size() - table.summary_rows) text += std::string(total, '-') + "\n";
    line.clear();
    for (std::size_t i = 0; i < table.rows[r].size(); ++i)
      line += (i > 0 ? kGap : "") + padded(shown(table.rows[r][i]), widths[i], is_left(table, i));
    text += trimmed(line);
  }
  return text;
}

std::string to_html(const FigureTable& table) {
  std::string s = R"(<div class="scroll"><table>)";
  if (!table.groups.empty()) {
    s += "<tr>";
    for (const ColumnGroup& group : table.groups)
      s += fmt::format(R"(<th colspan="{}"{}>{}</th>)", group.columns, group.name.empty() ? "" : " class=\"group\"",
                       escaped(group.name));
    s += "</tr>";
  }
  s += "<tr>";
  for (std::size_t i = 0; i < table.columns.size(); ++i)
    s += fmt::format("<th{}>{}</th>", is_left(table, i) ? " class=\"left\"" : "", escaped(table.columns[i]));
  s += "</tr>";
  for (std::size_t r = 0; r < table.rows.size(); ++r) {
    s += r + table.summary_rows == table.rows.size() ? R"(<tr class="foot">)" : "<tr>";
    for (std::size_t i = 0; i < table.rows[r].size(); ++i) {
      const TableCell& cell = table.rows[r][i];
      std::string content = escaped(cell.text);
      if (cell.best) content = "<b>" + content + "</b>";
      if (!cell.link.empty()) content = fmt::format(R"(<a href="{}">{}</a>)", escaped(cell.link), content);
      s += fmt::format(R"(<td class="{}{}">{}</td>)", is_left(table, i) ? "left" : "", cell.bad ? " bad" : "", content);
    }
    s += "</tr>";
  }
  return s + "</table></div>";
}

void mark_least(const std::vector<double>& values, std::vector<TableCell*> cells) {
  double least = std::numeric_limits<double>::infinity();
  int count = 0;
  for (const double v : values) {
    if (!std::isfinite(v)) continue;
    least = std::min(least, v);
    ++count;
  }
  for (std::size_t i = 0; count > 1 && i < cells.size(); ++i) cells[i]->best = values[i] == least;
}

}  // namespace epiline
