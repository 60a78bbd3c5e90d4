#pragma once
// A lens from views of a board alone: the start of the fit with the IMU.
#include <optional>
#include <vector>

#include "drivers/study/calibrate/board_pose.h"
#include "drivers/study/calibrate/corner_views.h"
#include "estimator/geometry/camera.h"
#include "platform/error/result.h"

namespace epiline {

struct LensFit {
  CameraParameters lens;
  BoardShape shape;
  double sigma_px = 0;  ///< of a corner, each image coordinate; by the median, so that few wrong corners do not count
  std::vector<std::optional<BoardPose>> poses;  ///< of each view
};

/// The lens of that model, and the shape of the board. `guess` is one place to start from; others are lenses without
/// distortion and of many focal lengths, so that a wrong guess does no harm, and none is needed. Fails if and only if
/// fewer than kLeastViews views have a pose, or no start leads to a lens that explains most of the corners.
Result<LensFit> fit_lens(const std::vector<CornerView>& views, CameraModel model, int width, int height,
                         const std::optional<CameraParameters>& guess);

/// A lens that is known: the shape of the board and the poses alone.
Result<LensFit> fit_board(const std::vector<CornerView>& views, const CameraParameters& lens);

/// Of all models the one that explains the corners best; where they do not tell, the first of radial-tangential,
/// equidistant, double sphere.
Result<LensFit> choose_lens(const std::vector<CornerView>& views, int width, int height);

inline constexpr int kLeastViews = 10;

}  // namespace epiline
