#include "estimator/monitor/evidence.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace epiline {

double innovation(const NavState& predicted, const StateCovariance& P, const NavState& solved) noexcept {
  const auto sigmas = [&](const Vec3& d, int at) {
    const double variance = P.diagonal().segment<3>(at).sum();
    return variance > 0 ? d.norm() / std::sqrt(variance) : std::numeric_limits<double>::infinity();
  };
  return std::max(sigmas(solved.v - predicted.v, 6), sigmas(local_pose(predicted, solved).tail<3>(), 3));
}

double sigma_velocity(const NavState& x, const StateCovariance& P) noexcept {
  Eigen::Matrix<double, 3, 6> J;  // by (dtheta, dv)
  J << skew(x.R.transpose() * x.v), x.R.transpose();
  Eigen::Matrix<double, 6, 6> C;
  C << P.block<3, 3>(3, 3), P.block<3, 3>(3, 6), P.block<3, 3>(6, 3), P.block<3, 3>(6, 6);
  return std::sqrt((J * C * J.transpose()).diagonal().maxCoeff());
}

double sigma_tilt(const NavState& x, const StateCovariance& P) noexcept {
  const Mat3 attitude = x.R * P.block<3, 3>(3, 3) * x.R.transpose();
  return std::sqrt(std::max(attitude(0, 0), attitude(1, 1)));
}

}  // namespace epiline
