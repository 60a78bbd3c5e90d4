#pragma once
// Where a camera stood before a board that is about flat.
#include <optional>

#include "drivers/study/calibrate/board_shape.h"
#include "drivers/study/calibrate/corner_views.h"
#include "estimator/geometry/camera.h"

namespace epiline {

/// Maps T to C.
struct BoardPose {
  Mat3 R_CT = Mat3::Identity();
  Vec3 t_CT = Vec3::Zero();
};

/// The pose by a homography between board and bearings, which needs no first guess and no pinhole; then a few steps
/// that make the pixels' errors least (robustly, `sigma_px` each). Nothing where fewer than `kCornersOfPose` corners
/// have a bearing, or they do not determine a pose with the board before the camera.
std::optional<BoardPose> board_pose(const Camera& camera, const CornerView& view, const BoardShape& shape,
                                    double sigma_px);

inline constexpr int kCornersOfPose = 8;

/// How far a residual counts (Cauchy), for a squared distance in standard deviations.
inline double cauchy_weight(double squared) { return 1 / (1 + squared / 9); }
/// The cost whose derivative that weight is.
double cauchy_cost(double squared);

}  // namespace epiline
