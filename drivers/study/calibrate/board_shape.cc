#include "drivers/study/calibrate/board_shape.h"

#include <algorithm>

namespace epiline {

namespace {
constexpr double kUsualShare = 0.003;
}

BoardShape::BoardShape(const std::vector<CornerView>& views) {
  Vec3 low = Vec3::Constant(1e9), high = -low;
  for (const CornerView& view : views) {
    for (const BoardCorner& corner : view.corners) {
      if (index_.try_emplace(corner.id, corners()).second) offsets_.push_back(Vec3::Zero());
      low = low.cwiseMin(corner.p_T);
      high = high.cwiseMax(corner.p_T);
    }
  }
  if (!offsets_.empty()) sigma_m_ = kUsualShare * std::max((high - low).maxCoeff(), 1e-3);
}

}  // namespace epiline
