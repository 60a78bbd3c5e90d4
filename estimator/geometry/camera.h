#pragma once
// Camera models: pixels <-> bearings. Camera frame C: x right, y down, z forward. Pixel (0, 0) is the centre of the top
// left pixel. Derivation: docs/derivations/cameras.md.
#include <array>
#include <cstdint>

#include "estimator/geometry/types.h"

namespace epiline {

enum class CameraModel {
  kPinholeRadialTangential,  ///< k1 k2 p1 p2 [k3]; directions up to 87 degrees off the axis
  kPinholeEquidistant,       ///< Kannala-Brandt k1 k2 k3 k4: fisheyes, also beyond 180 degrees
  kDoubleSphere,             ///< xi alpha (Usenko et al. 2018); fisheyes, also beyond 180 degrees
  kUnified,                  ///< alpha beta k1 k2 p1 p2: Mei's omnidirectional and the enhanced unified lens (EUCM)
};

/// fx fy cx cy in pixels; `distortion` as the model lists it, unused entries zero.
struct CameraParameters {
  CameraModel model = CameraModel::kPinholeRadialTangential;
  int width = 0, height = 0;
  std::array<double, 4> intrinsics{};
  std::array<double, 6> distortion{};
  double readout_s = 0;  ///< rolling shutter: exposure of the last row minus that of the first; 0: global
};

/// The first fault of a set of parameters.
enum class CameraFault : std::uint8_t {
  kNone,
  kSize,        ///< width or height not positive
  kNotFinite,   ///< a parameter is not a number
  kFocal,       ///< a focal length not positive
  kCentre,      ///< principal point outside the image
  kDistortion,  ///< alpha outside [0, 1]; double sphere: xi outside (-1, 1]; unified: beta not positive
};
CameraFault fault_of(const CameraParameters& parameters) noexcept;

class Camera {
 public:
  Camera() = default;
  /// Requires fault_of(parameters) == kNone.
  explicit Camera(const CameraParameters& parameters);

  /// Projects a point or direction in C to a pixel, which may lie outside the image. False where the model defines no
  /// pixel: behind the camera, or beyond the angle where the distortion folds back. `d_px_d_p`: derivative of the
  /// pixel, 2x3, px per unit of `p_C`.
  bool project(const Vec3& p_C, Vec2& px, Mat23* d_px_d_p = nullptr) const noexcept;
  /// Unit bearing of a pixel, to 1e-10 px in re-projection. False where the pixel has no bearing. Bounded work.
  bool unproject(const Vec2& px, Vec3& f_C) const noexcept;
  /// The same, and the derivative of the pixel at the unit bearing: the chart in which the bearing's noise is the
  /// pixel's. It annihilates the bearing.
  bool bearing(const Vec2& px, Vec3& f_C, Mat23& d_px_d_f) const noexcept;

  int width() const { return c_.width; }
  int height() const { return c_.height; }
  /// Pixels per radian near the axis.
  double focal_px() const;
  /// When row `y` is exposed, against the middle row, which the image's stamp is of.
  double row_s(double y) const { return c_.readout_s * (y / (c_.height - 1) - 0.5); }
  const CameraParameters& parameters() const { return c_; }

 private:
  CameraParameters c_;
  /// Radial-tangential and unified: largest squared radius before the distortion; equidistant: largest angle off the
  /// axis, rad.
  double limit_ = 0;
};

}  // namespace epiline
