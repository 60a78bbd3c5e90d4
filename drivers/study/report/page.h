#pragma once
// The parts of our HTML pages: each page stands alone, with its style and drawings inside.
#include <string>
#include <vector>

#include "drivers/study/report/program_info.h"

namespace epiline {

/// A whole page. `title` and `subtitle` are plain text, `body` is HTML.
std::string html_page(const std::string& title, const std::string& subtitle, const std::string& body);

/// A box with a heading; `note` and `content` are HTML. A wide one takes the whole row.
std::string html_card(const std::string& title, const std::string& note, const std::string& content, bool wide = false);

/// A figure to be read from afar; both HTML.
std::string html_tile(const std::string& value, const std::string& text);

/// Cells are HTML. The first column is aligned to the left, with `texts` all are.
using HtmlRow = std::vector<std::string>;
std::string html_table(const HtmlRow& head, const std::vector<HtmlRow>& rows, bool texts = false);

/// `epiline 0.1.0 (commit, build, SIMD)`
std::string program_text(const ProgramInfo& program);

}  // namespace epiline
