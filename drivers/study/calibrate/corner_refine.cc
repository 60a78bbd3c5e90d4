#include "drivers/study/calibrate/corner_refine.h"

#include <Eigen/Dense>
#include <cmath>

namespace epiline {

namespace {

double at(const GreyPixels& image, double x, double y) {
  const int column = static_cast<int>(x), row = static_cast<int>(y);
  const double u = x - column, v = y - row;
  const std::uint8_t *above = image.row(row) + column, *below = image.row(row + 1) + column;
  return (1 - v) * ((1 - u) * above[0] + u * above[1]) + v * ((1 - u) * below[0] + u * below[1]);
}

}  // namespace

bool refine_corner(const GreyPixels& image, int half, Vec2& px) {
  constexpr int kMost = 15;
  constexpr double kSettled_px = 0.003;
  const Vec2 start = px;
  Vec2 centre = px;
  for (int i = 0; i < kMost; ++i) {
    if (!(centre.x() - half - 1 >= 0 && centre.y() - half - 1 >= 0 && centre.x() + half + 2 < image.width &&
          centre.y() + half + 2 < image.height))
      return false;
    Eigen::Matrix2d A = Eigen::Matrix2d::Zero();
    Vec2 b = Vec2::Zero();
    for (int dy = -half; dy <= half; ++dy) {
      for (int dx = -half; dx <= half; ++dx) {
        const double x = centre.x() + dx, y = centre.y() + dy;
        const Vec2 gradient(at(image, x + 1, y) - at(image, x - 1, y), at(image, x, y + 1) - at(image, x, y - 1));
        const double share = 1.0 / (half * half);
        const double weight = std::exp(-share * (dx * dx + dy * dy));
        const Eigen::Matrix2d G = weight * gradient * gradient.transpose();
        A += G;
        b += G * Vec2(dx, dy);
      }
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(A);
    constexpr double kCorner = 0.02;  // the lesser of the two directions' share: an edge has none
    if (!(eigen.eigenvalues()[0] > kCorner * eigen.eigenvalues()[1])) return false;
    const Vec2 step = A.ldlt().solve(b);
    centre += step;
    if (!((centre - start).norm() < half)) return false;
    if (step.norm() < kSettled_px) break;
  }
  px = centre;
  return true;
}

}  // namespace epiline
