#include "drivers/study/calibrate/corner_refine.h"

#include <Eigen/LU>
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
    // Of A's two eigenvalues the lesser is more than kCorner times the larger: an edge has only one. With the ratio r
    // of the two, det(A) / tr(A)^2 = r / (1 + r)^2, which grows with r.
    constexpr double kCorner = 0.02;
    const double trace = A.trace();
    if (!(A.determinant() > kCorner / ((1 + kCorner) * (1 + kCorner)) * trace * trace)) return false;
    const Vec2 step = A.inverse() * b;
    centre += step;
    if (!((centre - start).norm() < half)) return false;
    if (step.norm() < kSettled_px) break;
  }
  px = centre;
  return true;
}

}  // namespace epiline
