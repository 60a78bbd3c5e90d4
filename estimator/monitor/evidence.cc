#include "estimator/monitor/evidence.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace epiline {

double innovation(const NavState& predicted, const NewestCovariance& P, const NavState& solved) noexcept {
  const auto sigmas = [&](const Vec3& d, int at) {
    const double variance = P.diagonal().segment<3>(at).sum();
    return variance > 0 ? d.norm() / std::sqrt(variance) : std::numeric_limits<double>::infinity();
  };
  return std::max(sigmas(solved.v - predicted.v, 6), sigmas(local_pose(predicted, solved).tail<3>(), 3));
}

}  // namespace epiline
