#include "drivers/study/calibrate/lens_columns.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace epiline {

namespace {

struct LensModel {
  const char* name;
  std::vector<const char*> coefficients;
};

const LensModel& model_of(CameraModel model) {
  static const std::array<LensModel, 4> kModels = {{{"radial-tangential", {"k1", "k2", "p1", "p2", "k3"}},
                                                    {"equidistant", {"k1", "k2", "k3", "k4"}},
                                                    {"double-sphere", {"xi", "alpha"}},
                                                    {"unified", {"alpha", "beta", "k1", "k2", "p1", "p2"}}}};
  return kModels[static_cast<std::size_t>(model)];
}

}  // namespace

int lens_columns(CameraModel model) { return 4 + static_cast<int>(model_of(model).coefficients.size()); }

const char* lens_column_name(CameraModel model, int column) {
  static constexpr std::array kFirst = {"fx", "fy", "cx", "cy"};
  const auto i = static_cast<std::size_t>(column);
  return i < kFirst.size() ? kFirst[i] : model_of(model).coefficients[i - kFirst.size()];
}

const char* name_of(CameraModel model) { return model_of(model).name; }

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
