#pragma once
// The numbers of a lens as unknowns of a fit, and a point's pixel with its derivatives by them.
#include <array>

#include "estimator/geometry/camera.h"

namespace epiline {

/// Focal lengths and centre first, the model's coefficients behind as Camera lists them.
inline constexpr int kMostLensColumns = 10;
using LensStep = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMostLensColumns, 1>;
using LensJacobian = Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, kMostLensColumns>;

int lens_columns(CameraModel model);
LensStep lens_values(const CameraParameters& lens);
/// The lens with these values, held where the model has a meaning (positive focal lengths, centre inside the image).
CameraParameters lens_with(const CameraParameters& lens, const LensStep& values);
/// "fx", "k1", "xi": for reports.
const char* lens_column_name(CameraModel model, int column);
const char* name_of(CameraModel model);

/// Displacements of a pixel that no model has: along the ray from the centre, with the ninth and the eleventh power of
/// the distance from there; 1 px at half the image's diagonal.
inline constexpr int kLensTerms = 2;
Eigen::Matrix<double, 2, kLensTerms> lens_terms(const CameraParameters& lens, const Vec2& px);

class LensProjection {
 public:
  explicit LensProjection(const CameraParameters& lens);
  /// Like Camera::project(), with the derivatives by the lens' numbers: exact for the first four, central differences
  /// for the coefficients, so that no model is written twice.
  bool project(const Vec3& p_C, Vec2& px, Mat23& d_px_d_p, LensJacobian& d_px_d_lens) const;
  const Camera& camera() const { return camera_; }

 private:
  static constexpr double kStep = 1e-6;
  struct Pair {
    Camera plus, minus;
    double distance;
  };
  Camera camera_;
  int columns_;
  std::array<Pair, kMostLensColumns - 4> varied_;
};

}  // namespace epiline
