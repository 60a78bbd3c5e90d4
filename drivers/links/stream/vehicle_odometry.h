#pragma once
// An estimate in the axes of the vehicle, as a receiver of odometry expects it: the geometry that all links share.
#include <Eigen/Core>
#include <array>

#include "estimator/geometry/types.h"
#include "platform/samples/samples.h"

namespace epiline {

/// Upper triangle of a symmetric 6x6 matrix, row by row. If any element is not finite, the first one is not a number.
using Covariance6 = std::array<float, 21>;

/// Vehicle axes V: x forward, y left, z up (ISO 8855). World W: z up. Single precision is finer than what any link
/// sends. The pose is that of the IMU.
struct VehicleOdometry {
  Mat3 R_WV;                  ///< turns vectors of V into W
  std::array<float, 4> q_WV;  ///< w x y z of the same, of norm 1
  Eigen::Vector3f v_V_m_s;
  Eigen::Vector3f omega_V_rad_s;
  Covariance6 pose_covariance;      ///< position, and rotation about the axes of W, so that its z is the heading
  Covariance6 velocity_covariance;  ///< velocity in V, the doubt about attitude included, and rates in V
};

/// `R_VB` turns vectors of the IMU's axes B into V. Does not allocate.
VehicleOdometry in_vehicle_axes(const Odometry& odometry, const Mat3& R_VB) noexcept;

}  // namespace epiline
