#include "estimator/initialise/stationary_start.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "estimator/initialise/start_problem.h"

namespace epiline {
namespace {

constexpr double kUnseenMotion = 2e-3;  // rad/s, m/s: what a rest detector may overlook

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

std::optional<StartRefusal> solve_stationary_start(const RestReadings& rest, const ImuNoise& noise, double b_a_sigma,
                                                   InitialState& state, double force_tolerance) {
  if (!(rest.duration_s > 0) || !rest.specific_force.allFinite() || !rest.rate.allFinite()) return StartRefusal::kNoImu;
  if (!(std::abs(rest.specific_force.norm() - kGravity) <= force_tolerance)) return StartRefusal::kBiasImplausible;
  state = {};
  state.R_WB = levelled(rest.specific_force.normalized());
  state.b_g = rest.rate;
  const double mean_of_noise = 1 / std::sqrt(rest.duration_s);
  state.sigma_tilt = std::hypot(b_a_sigma, noise.accelerometer_density * mean_of_noise) / kGravity;
  state.sigma_b_g = std::hypot(kUnseenMotion, noise.gyroscope_density * mean_of_noise);
  state.sigma_v = 10 * kUnseenMotion;
  state.sigma_b_a = b_a_sigma;
  return std::nullopt;
}

}  // namespace epiline
