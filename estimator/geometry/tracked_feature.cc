#include "estimator/geometry/tracked_feature.h"

namespace epiline {

bool set_pixel(const Camera& camera, const Vec2& px, TrackedFeature& feature) noexcept {
  Vec3 f_C;
  Mat23 J;
  if (!camera.bearing(px, f_C, J)) return false;
  feature.pixel = {static_cast<float>(px.x()), static_cast<float>(px.y())};
  feature.row_s = static_cast<float>(camera.row_s(px.y()));
  Vec3::Map(feature.bearing.data()) = f_C;
  Eigen::Map<RowMat23>(feature.pixel_jacobian.data()) = J;
  return true;
}

}  // namespace epiline
