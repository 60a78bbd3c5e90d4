#pragma once
// Normal equations that keep every block apart, by the names of its unknowns.
#include <array>
#include <map>
#include <utility>

#include "estimator/factors/normal_equations.h"

namespace epiline::test {

class NamedBlocks final : public NormalEquations {
 public:
  Block block(Unknown row, Unknown column) noexcept override { return {H[{key(row), key(column)}].data(), 9, 1}; }
  double* rhs(Unknown a) noexcept override { return b[key(a)].data(); }
  static int key(Unknown a) { return 100 * static_cast<int>(a.kind) + a.frame; }

  /// Zero where no factor has said anything.
  double slope(Unknown a, int i) const {
    const auto found = b.find(key(a));
    return found == b.end() ? 0 : found->second[static_cast<std::size_t>(i)];
  }
  double curvature(Unknown a, int i) const {
    const auto found = H.find({key(a), key(a)});
    return found == H.end() ? 0 : found->second[static_cast<std::size_t>(10 * i)];
  }

  std::map<std::pair<int, int>, std::array<double, 81>> H;
  std::map<int, std::array<double, 9>> b;
};

}  // namespace epiline::test
