#include "estimator/predict/covariance.h"

namespace epiline {

namespace {

// M <- B M for B = diag(R, I, R, I, I).
template <class Matrix>
void turn_rows(const Mat3& R, Matrix& M) {
  for (const int row : {0, 6}) M.template middleRows<3>(row) = (R * M.template middleRows<3>(row)).eval();
}

// M <- B M B^T.
void turn_both_sides(const Mat3& R, Mat15& M) {
  turn_rows(R, M);
  M.transposeInPlace();
  turn_rows(R, M);
}

}  // namespace

BodyCovariance into_body(const StateCovariance& P, const Mat3& R_WB) noexcept {
  BodyCovariance b{P.topLeftCorner<15, 15>(), P.topRightCorner<15, 1>(), P(15, 15)};
  turn_both_sides(R_WB.transpose(), b.states);
  turn_rows(R_WB.transpose(), b.time_offset);
  return b;
}

StateCovariance carried_on(const BodyCovariance& from, const Mat3& R_WB, const Preintegration& interval) noexcept {
  // J leaves the biases as they are, so only its upper nine rows are multiplied.
  const auto J = interval.J.topRows<9>();
  const Eigen::Matrix<double, 9, 15> J_P = J.lazyProduct(from.states);
  Mat15 P = interval.C;
  P.topLeftCorner<9, 9>() += J_P.lazyProduct(J.transpose());
  P.topRightCorner<9, 6>() += J_P.rightCols<6>();
  P.bottomLeftCorner<6, 9>() += J_P.rightCols<6>().transpose();
  P.bottomRightCorner<6, 6>() += from.states.bottomRightCorner<6, 6>();
  Vec15 P_td = from.time_offset;
  P_td.head<9>() = J * from.time_offset;
  turn_both_sides(R_WB, P);
  turn_rows(R_WB, P_td);
  StateCovariance C;
  C.topLeftCorner<15, 15>() = 0.5 * (P + P.transpose());
  C.topRightCorner<15, 1>() = P_td;
  C.bottomLeftCorner<1, 15>() = P_td.transpose();
  C(15, 15) = from.offset_variance;
  return C;
}

StateCovariance without_origin(const NavState& x, const StateCovariance& P) noexcept {
  const Vec3 up = Vec3::UnitZ(), up_B = x.R.transpose() * up;
  StateCovariance without = StateCovariance::Identity();
  without.topRows<3>().setZero();
  without.block<3, 3>(3, 3) -= up_B * up_B.transpose();
  without.block<3, 3>(6, 3) = -up.cross(x.v) * up_B.transpose();
  without(15, 15) = 0;
  const StateCovariance C = without * P * without.transpose();
  return C.selfadjointView<Eigen::Lower>();
}

void widen(const NavState& x, double factor, StateCovariance& P) noexcept { P += (factor - 1) * without_origin(x, P); }

StateCovariance covariance_added(const WorldUncertainty& world, const NavState& x) noexcept {
  const Vec3 up = Vec3::UnitZ();
  Eigen::Matrix<double, 16, 1> turn;
  turn << up.cross(x.p - world.p), x.R.transpose() * up, up.cross(x.v), Vec3::Zero(), Vec3::Zero(), 0;
  StateCovariance C = world.sigma_yaw * world.sigma_yaw * turn * turn.transpose();
  C.diagonal().head<3>().array() += world.sigma_p * world.sigma_p;
  return C;
}

}  // namespace epiline
