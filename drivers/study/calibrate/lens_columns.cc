#include "drivers/study/calibrate/lens_columns.h"

#include <algorithm>
#include <cmath>

namespace epiline {

int lens_columns(CameraModel model) {
  switch (model) {
    case CameraModel::kPinholeRadialTangential:
      return 9;
    case CameraModel::kPinholeEquidistant:
      return 8;
    case CameraModel::kDoubleSphere:
      return 6;
    case CameraModel::kUnified:
      return 10;
  }
  return 0;
}

LensStep lens_values(const CameraParameters& lens) {
  LensStep values(lens_columns(lens.model));
  for (int i = 0; i < 4; ++i) values[i] = lens.intrinsics[static_cast<std::size_t>(i)];
  for (int i = 4; i < values.size(); ++i) values[i] = lens.distortion[static_cast<std::size_t>(i - 4)];
  return values;
}

CameraParameters lens_with(const CameraParameters& lens, const LensStep& values) {
  CameraParameters changed = lens;
  for (int i = 0; i < 4; ++i) changed.intrinsics[static_cast<std::size_t>(i)] = values[i];
  for (int i = 4; i < values.size(); ++i) changed.distortion[static_cast<std::size_t>(i - 4)] = values[i];
  auto& [fx, fy, cx, cy] = changed.intrinsics;
  const double least = 0.05 * lens.width;
  fx = std::max(fx, least);
  fy = std::max(fy, least);
  cx = std::clamp(cx, 0.0, lens.width - 1.0);
  cy = std::clamp(cy, 0.0, lens.height - 1.0);
  if (lens.model == CameraModel::kDoubleSphere) {
    changed.distortion[0] = std::clamp(changed.distortion[0], -0.99, 0.99);
    changed.distortion[1] = std::clamp(changed.distortion[1], 0.01, 0.99);
  }
  return changed;
}

const char* lens_column_name(CameraModel model, int column) {
  static constexpr std::array<const char*, 4> kFirst = {"fx", "fy", "cx", "cy"}, kAngle = {"k1", "k2", "k3", "k4"};
  static constexpr std::array<const char*, 5> kRadial = {"k1", "k2", "p1", "p2", "k3"};
  static constexpr std::array<const char*, 2> kSpheres = {"xi", "alpha"};
  static constexpr std::array<const char*, 6> kUnified = {"alpha", "beta", "k1", "k2", "p1", "p2"};
  const auto i = static_cast<std::size_t>(column);
  if (i < 4) return kFirst[i];
  if (model == CameraModel::kDoubleSphere) return kSpheres[i - 4];
  if (model == CameraModel::kUnified) return kUnified[i - 4];
  return model == CameraModel::kPinholeEquidistant ? kAngle[i - 4] : kRadial[i - 4];
}

const char* name_of(CameraModel model) {
  switch (model) {
    case CameraModel::kPinholeRadialTangential:
      return "radial-tangential";
    case CameraModel::kPinholeEquidistant:
      return "equidistant";
    case CameraModel::kDoubleSphere:
      return "double-sphere";
    case CameraModel::kUnified:
      return "unified";
  }
  return "";
}

Eigen::Matrix<double, 2, kLensTerms> lens_terms(const CameraParameters& lens, const Vec2& px) {
  const auto& [fx, fy, cx, cy] = lens.intrinsics;
  const Vec2 r = (px - Vec2(cx, cy)) / (0.5 * std::hypot(lens.width, lens.height));
  const double r4 = r.squaredNorm() * r.squaredNorm(), r8 = r4 * r4;
  Eigen::Matrix<double, 2, kLensTerms> terms;
  terms << r8 * r, r8 * r.squaredNorm() * r;
  return terms;
}

LensProjection::LensProjection(const CameraParameters& lens) : camera_(lens), columns_(lens_columns(lens.model)) {
  const LensStep values = lens_values(lens);
  for (int i = 4; i < columns_; ++i) {
    LensStep more = values, less = values;
    more[i] += kStep;
    less[i] -= kStep;
    varied_[static_cast<std::size_t>(i - 4)] = {Camera(lens_with(lens, more)), Camera(lens_with(lens, less)),
                                                2 * kStep};
  }
}

bool LensProjection::project(const Vec3& p_C, Vec2& px, Mat23& d_px_d_p, LensJacobian& J) const {
  if (!camera_.project(p_C, px, &d_px_d_p)) return false;
  const auto& [fx, fy, cx, cy] = camera_.parameters().intrinsics;
  J.setZero(2, columns_);
  J(0, 0) = (px.x() - cx) / fx;
  J(1, 1) = (px.y() - cy) / fy;
  J(0, 2) = J(1, 3) = 1;
  for (int i = 4; i < columns_; ++i) {
    const Pair& pair = varied_[static_cast<std::size_t>(i - 4)];
    Vec2 more, less;
    if (pair.plus.project(p_C, more) && pair.minus.project(p_C, less)) J.col(i) = (more - less) / pair.distance;
  }
  return true;
}

}  // namespace epiline
