#include "estimator/geometry/camera.h"

#include <cmath>

namespace epiline {

namespace {
void distort(const std::array<double, 5>& k, double x, double y, double& u, double& v) {
  const double r2 = x * x + y * y, radial = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
  u = x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x);
  v = y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y;
}
}  // namespace

bool Camera::project(const Vec3& p, Vec2& px, Mat23* J) const noexcept {
  if (p.z() <= 0) return false;
  const double x = p.x() / p.z(), y = p.y() / p.z();
  double u = 0, v = 0;
  distort(c_.distortion, x, y, u, v);
  px = {c_.intrinsics[0] * u + c_.intrinsics[2], c_.intrinsics[1] * v + c_.intrinsics[3]};
  if (J) {
    const auto& k = c_.distortion;
    const double r2 = x * x + y * y, radial = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
    const double d = 2 * (k[0] + r2 * (2 * k[1] + 3 * r2 * k[4]));
    const double uv = d * x * y + 2 * k[2] * x + 2 * k[3] * y;
    const double uu = radial + d * x * x + 2 * k[2] * y + 6 * k[3] * x;
    const double vv = radial + d * y * y + 6 * k[2] * y + 2 * k[3] * x;
    Eigen::Matrix2d D;
    D << c_.intrinsics[0] * uu, c_.intrinsics[0] * uv, c_.intrinsics[1] * uv, c_.intrinsics[1] * vv;
    Mat23 P;
    P << 1, 0, -x, 0, 1, -y;
    *J = D * P / p.z();
  }
  return true;
}

bool Camera::unproject(const Vec2& px, Vec3& f) const noexcept {
  const double xd = (px.x() - c_.intrinsics[2]) / c_.intrinsics[0], yd = (px.y() - c_.intrinsics[3]) / c_.intrinsics[1];
  double x = xd, y = yd;
  for (int i = 0; i < 20; ++i) {
    double u = 0, v = 0;
    distort(c_.distortion, x, y, u, v);
    x += xd - u;
    y += yd - v;
  }
  f = Vec3(x, y, 1).normalized();
  return true;
}

}  // namespace epiline
