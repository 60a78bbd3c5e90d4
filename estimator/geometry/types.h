#pragma once
#include <Eigen/Core>
#include <Eigen/Geometry>  // cross products, wherever a vector is used

namespace epiline {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;
using Mat23 = Eigen::Matrix<double, 2, 3>;

}  // namespace epiline
