#pragma once
#include <algorithm>
#include <numeric>
#include <string>
#include <string_view>
#include <vector>

namespace epiline {

/// How many letters must be added, removed or changed to make `b` of `a` (Levenshtein's distance).
inline std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0]++;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t changed = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({changed, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row.back();
}

/// The name that was probably meant; empty if none is near.
inline std::string nearest(std::string_view wrong, const std::vector<std::string>& names) {
  const auto distance = [&](const std::string& name) { return edit_distance(wrong, name); };
  const auto best = std::min_element(names.begin(), names.end(), [&](const std::string& a, const std::string& b) {
    return distance(a) < distance(b);
  });
  const bool is_near = best != names.end() && distance(*best) <= std::max<std::size_t>(1, wrong.size() / 3);
  return is_near ? *best : "";
}

}  // namespace epiline
