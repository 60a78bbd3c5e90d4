#include "estimator/initialise/stationary_start.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "estimator/geometry/so3.h"
#include "estimator/initialise/start_problem.h"

namespace epiline {
namespace {

constexpr double kUnseenMotion = 2e-3;  // rad/s, m/s: what a rest detector may overlook
constexpr double kUnseenForce = 0.02;   // m/s^2, the same over half a second

}  // namespace

Mat3 levelled(const Vec3& up_B) {
  const Vec3 ahead = std::abs(up_B.x()) < 0.99 ? Vec3::UnitX() : Vec3::UnitY();
  const Vec3 x = (ahead - ahead.dot(up_B) * up_B).normalized();
  Mat3 R_WB;
  R_WB.row(0) = x;
  R_WB.row(1) = up_B.cross(x);
  R_WB.row(2) = up_B;
  return R_WB;
}

double heading_from(const Mat3& R_WB, const Mat3& reference) {
  const Mat3 turn = reference * R_WB.transpose();
  return std::atan2(turn(1, 0) - turn(0, 1), turn(0, 0) + turn(1, 1));
}

/// The standard error of the means holds what shaking and noise leave of them.
RestBiases biases_at_rest(const ImuStatistics& rest, const ImuScale& scale, const Mat3& R_WB) noexcept {
  const double root = std::sqrt(std::max(1, rest.count));
  return {rest.mean_specific_force + R_WB.transpose() * kGravity_W / (1 + scale.accelerometer), rest.mean_rate,
          std::hypot(kUnseenForce, rest.sigma_specific_force / root),
          std::hypot(kUnseenMotion, rest.sigma_rate / root)};
}

StateCovariance covariance_at_rest(const RestBiases& at_rest, const Mat3& R_WB, const StateCovariance& P) noexcept {
  Eigen::Matrix<double, 16, 6> by_pose = Eigen::Matrix<double, 16, 6>::Zero();
  by_pose.topRows<6>().setIdentity();
  by_pose.block<3, 3>(9, 3) = skew(R_WB.transpose() * kGravity_W);
  StateCovariance C = by_pose * P.topLeftCorner<6, 6>() * by_pose.transpose();
  const auto add = [&C](int row, double sigma) { C.diagonal().segment<3>(row).array() += sigma * sigma; };
  add(6, 10 * kUnseenMotion);
  add(9, at_rest.sigma_b_a);
  add(12, at_rest.sigma_b_g);
  C(15, 15) = P(15, 15);
  return C;
}

std::optional<StartRefusal> solve_stationary_start(const ImuStatistics& rest, const ImuNoise& noise, double b_a_sigma,
                                                   InitialState& state, double force_tolerance) {
  const Vec3 &force = rest.mean_specific_force, &rate = rest.mean_rate;
  if (!(rest.duration_s > 0) || !force.allFinite() || !rate.allFinite()) return StartRefusal::kNoImu;
  if (!(std::abs(force.norm() - kGravity) <= force_tolerance)) return StartRefusal::kBiasImplausible;
  state = {};
  state.R_WB = levelled(force.normalized());
  state.b_g = rate;
  const double mean_of_noise = 1 / std::sqrt(rest.duration_s), mean_of_shaking = 1 / std::sqrt(std::max(1, rest.count));
  state.sigma_tilt =
      std::hypot(b_a_sigma, noise.accelerometer_density * mean_of_noise, rest.sigma_specific_force * mean_of_shaking) /
      kGravity;
  state.sigma_b_g =
      std::hypot(kUnseenMotion, noise.gyroscope_density * mean_of_noise, rest.sigma_rate * mean_of_shaking);
  state.sigma_v = 10 * kUnseenMotion;
  state.sigma_b_a = b_a_sigma;
  return std::nullopt;
}

}  // namespace epiline
