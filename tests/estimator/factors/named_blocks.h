#pragma once
// Normal equations that keep every block apart, by the names of its unknowns.
#include <array>
#include <map>
#include <utility>

#include "estimator/factors/normal_equations.h"
#include "estimator/window/capacity.h"

namespace epiline::test {

class NamedBlocks final : public NormalEquations {
 public:
  static constexpr int kMost = kCalibration;  ///< numbers of one unknown
  Block block(Unknown row, Unknown column) noexcept override {
    return {H[{key(row), key(column)}].data() + kMost * first(row) + first(column), kMost, 1};
  }
  double* rhs(Unknown a) noexcept override { return b[key(a)].data() + first(a); }
  /// The scales of the IMU stand behind the camera's calibration.
  static int key(Unknown a) {
    const auto kind = a.kind == Unknown::Kind::kScales ? Unknown::Kind::kCamera : a.kind;
    return 100 * static_cast<int>(kind) + a.frame;
  }
  static int first(Unknown a) { return a.kind == Unknown::Kind::kScales ? kCameraCalibration : 0; }

  /// Zero where no factor has said anything.
  double slope(Unknown a, int i) const {
    const auto found = b.find(key(a));
    return found == b.end() ? 0 : found->second[static_cast<std::size_t>(i)];
  }
  double curvature(Unknown a, int i) const {
    const auto found = H.find({key(a), key(a)});
    return found == H.end() ? 0 : found->second[static_cast<std::size_t>((kMost + 1) * i)];
  }

  std::map<std::pair<int, int>, std::array<double, kMost * kMost>> H;
  std::map<int, std::array<double, kMost>> b;
};

}  // namespace epiline::test
