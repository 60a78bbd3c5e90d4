#pragma once
// Camera models: pixels <-> bearings. Camera frame C: x right, y down, z forward. Pixel (0, 0) is the centre of the top left pixel.
#include <array>
#include <optional>
#include <string>

#include "estimator/geometry/types.h"

namespace epiline {

enum class CameraModel {
  kPinholeRadialTangential,  ///< k1 k2 p1 p2 [k3]
  kPinholeEquidistant,       ///< Kannala-Brandt k1 k2 k3 k4: fisheyes, also beyond 180 degrees
  kDoubleSphere,             ///< xi alpha (Usenko et al. 2018)
};

/// fx fy cx cy in pixels; `distortion` as the model lists it, unused entries zero.
struct CameraParameters {
  CameraModel model = CameraModel::kPinholeRadialTangential;
  int width = 0, height = 0;
  std::array<double, 4> intrinsics{};
  std::array<double, 5> distortion{};
};

class Camera {
 public:
  Camera() = default;
  explicit Camera(const CameraParameters& parameters) : c_(parameters) {}

  /// Pixel of a point or direction in C. False where the model does not define one (behind the camera, past the edge of its domain).
  /// `d_px_d_p`: derivative of the pixel, 2x3, px per unit of `p_C`.
  bool project(const Vec3& p_C, Vec2& px, Mat23* d_px_d_p = nullptr) const noexcept;
  /// Unit bearing of a pixel, to 1e-10 px in re-projection. False where the pixel has no bearing.
  bool unproject(const Vec2& px, Vec3& f_C) const noexcept;

  int width() const { return c_.width; }
  int height() const { return c_.height; }
  /// Pixels per radian near the axis.
  double focal_px() const { return 0.5 * (c_.intrinsics[0] + c_.intrinsics[1]); }
  const CameraParameters& parameters() const { return c_; }

 private:
  CameraParameters c_;
};

}  // namespace epiline
