#pragma once
#include <Eigen/Core>
#include <Eigen/Geometry>  // cross products, wherever a vector is used
#include <array>

namespace epiline {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;
using RowMat3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using Mat23 = Eigen::Matrix<double, 2, 3>;
using RowMat23 = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;
using Mat6 = Eigen::Matrix<double, 6, 6>;
using Vec6 = Eigen::Matrix<double, 6, 1>;
using Vec9 = Eigen::Matrix<double, 9, 1>;
using Vec15 = Eigen::Matrix<double, 15, 1>;
using Mat15 = Eigen::Matrix<double, 15, 15>;

inline Vec3 vec3(const std::array<double, 3>& a) { return {a[0], a[1], a[2]}; }

}  // namespace epiline
