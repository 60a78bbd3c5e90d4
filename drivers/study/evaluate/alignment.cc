#include "drivers/study/evaluate/alignment.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <cmath>

namespace epiline {

namespace {

Vec3 mean_of(const std::vector<Vec3>& points) {
  Vec3 sum = Vec3::Zero();
  for (const Vec3& x : points) sum += x;
  return sum / static_cast<double>(points.size());
}

/// The rotation R that maximises trace(R S), S = sum of e_i r_i^T: the largest eigenvector of Horn's matrix is its
/// quaternion.
Mat3 best_rotation(const Mat3& S) {
  Eigen::Matrix4d N;
  N << S.trace(), S(1, 2) - S(2, 1), S(2, 0) - S(0, 2), S(0, 1) - S(1, 0),   //
      0, S(0, 0) - S(1, 1) - S(2, 2), S(0, 1) + S(1, 0), S(2, 0) + S(0, 2),  //
      0, 0, -S(0, 0) + S(1, 1) - S(2, 2), S(1, 2) + S(2, 1),                 //
      0, 0, 0, -S(0, 0) - S(1, 1) + S(2, 2);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> solver(
      Eigen::Matrix4d(N.transpose()));  // reads the lower triangle
  const Eigen::Vector4d q = solver.eigenvectors().col(3);
  return Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix();
}

}  // namespace

std::optional<Alignment> alignment_from(const std::string& name) {
  if (name == "none") return Alignment::kNone;
  if (name == "4dof") return Alignment::k4Dof;
  if (name == "se3") return Alignment::kSe3;
  if (name == "sim3") return Alignment::kSim3;
  return std::nullopt;
}

double yaw_of(const Mat3& R) { return std::atan2(R(1, 0) - R(0, 1), R(0, 0) + R(1, 1)); }

Mat3 yaw_rotation(double yaw_rad) { return Eigen::AngleAxisd(yaw_rad, Vec3::UnitZ()).toRotationMatrix(); }

Similarity align(Alignment family, const std::vector<Vec3>& estimate, const std::vector<Vec3>& reference) {
  Similarity T;
  if (family == Alignment::kNone || estimate.empty()) return T;
  const Vec3 e_mean = mean_of(estimate), r_mean = mean_of(reference);
  Mat3 S = Mat3::Zero();
  double e_squares = 0;
  for (std::size_t i = 0; i < estimate.size(); ++i) {
    const Vec3 e = estimate[i] - e_mean;
    S += e * (reference[i] - r_mean).transpose();
    e_squares += e.squaredNorm();
  }
  T.R = family == Alignment::k4Dof ? yaw_rotation(yaw_of(S.transpose())) : best_rotation(S);
  if (family == Alignment::kSim3 && e_squares > 0) T.s = (T.R * S).trace() / e_squares;
  T.t = r_mean - T.s * (T.R * e_mean);
  return T;
}

}  // namespace epiline
