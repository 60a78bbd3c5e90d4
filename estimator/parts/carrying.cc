#include "estimator/parts/carrying.h"

#include "estimator/monitor/evidence.h"
#include "estimator/predict/covariance.h"

namespace epiline {

namespace {
constexpr double kCarriedStep_s = 1;  // without a solved frame the IMU carries the state on in steps of this length
// A carried state is worth going on from while a few seconds of images can mend it; beyond, a start searches anew.
constexpr double kMostVelocity = 1, kMostTilt = 0.1;  // m/s, rad
}  // namespace

/// Whether forces tell nothing of the motion since a state: readings are missing, or nobody knows how much of
/// them is gravity.
bool Carrying::forces_are_unknown(const KnownState& from, HostStamp until) const {
  if (intervals_.is_silent(from.time, until)) return true;
  return !common_.started && sigma_tilt(from.x, from.P) > kMostTilt;
}

StateCovariance Carrying::doubt_of_calibration(const CrossCovariance& cross) const {
  const StateCovariance P = cross.lazyProduct(common_.calibration_doubt).lazyProduct(cross.transpose());
  return (P + P.transpose()) / 2;  // to the last digit
}

/// What is known at the end of an interval that begins at that state. The scales of its readings are no better known
/// than the calibration.
void Carrying::through(const Preintegration& interval, const Mat3& R_WB, KnownState& s) const {
  CrossCovariance& cross = s.with_calibration;
  s.P = carried_on(into_body(s.P - doubt_of_calibration(cross), R_WB), R_WB, interval);
  Eigen::Matrix<double, 9, 15> J = interval.J.topRows<9>();
  ScaleColumns by_scale = interval.by_scale();
  for (const int at : {0, 6}) {  // from the axes of the body, in which the interval is
    J.middleCols<3>(at) = (J.middleCols<3>(at) * R_WB.transpose()).eval();
    J.middleRows<3>(at) = (R_WB * J.middleRows<3>(at)).eval();
    by_scale.middleRows<3>(at) = (R_WB * by_scale.middleRows<3>(at)).eval();
  }
  const auto scales = common_.calibration_covariance.bottomRows<kImuScales>();
  cross.topRows<9>() = (J.lazyProduct(cross.topRows<15>()) + by_scale.lazyProduct(scales)).eval();
  const Eigen::Matrix<double, 15, 9> both = cross.topRightCorner<15, kImuScales>() * by_scale.transpose();
  s.P.topLeftCorner<15, 9>() += both;
  s.P.topLeftCorner<9, 15>() += both.transpose();
  s.P.topLeftCorner<9, 9>() -= by_scale * scales.rightCols<kImuScales>() * by_scale.transpose();
  s.P += doubt_of_calibration(cross);
}

KnownState Carrying::on_to(const KnownState& from, HostStamp time) const {
  KnownState s = from;
  if (!s.known || time <= s.time) return s;
  const Window& window = common_.window;
  const ImuHistory& history = common_.history;
  const ImuHistory::Density& density = common_.noise.of_intervals();
  Preintegration interval;
  interval.reset(s.x.b_a, s.x.b_g, window.calibration.scale);
  if (!history.integrate(s.time, time, density, interval)) return s;
  history.propagate(from.time, time, window.calibration.scale, s.x, s.omega);
  if (window.size() > 0 && window.newest().forces_doubted && interval.T < kLongestUnknown_s)
    interval.doubt_forces(kAnyAcceleration);  // what contradicted a moment ago may still do so
  if (forces_are_unknown(from, time)) {
    interval.forget_forces(density.gap_acceleration);
    s.x.p = from.x.p + interval.T * from.x.v;
    s.x.v = from.x.v;
  }
  through(interval, from.x.R, s);
  s.time = time;
  return s;
}

KnownState Carrying::predicted_newest() const {
  const KnownState& carried = common_.carried;
  const Slot& newest = common_.window.newest();
  if (carried.time != common_.window.at(common_.window.size() - 2).time)  // an IMU that outlasts the camera
    return to(newest.time);
  KnownState s = carried;
  through(newest.imu, carried.x.R, s);
  s.time = newest.time;
  s.x = newest.x;
  s.omega = newest.omega;
  return s;
}

void Carrying::keep_up() {
  KnownState& carried = common_.carried;
  const HostStamp newest = common_.history.newest().stamp;
  if (!carried.known || (newest - carried.time).seconds() < kCarriedStep_s) return;
  from_ = carried;
  carried = to(newest);
  reached_ = carried.time;
}

bool may_go_on(const KnownState& s) {
  if (!s.known || !s.trusted || !s.P.allFinite() || !s.x.p.allFinite() || !s.x.R.allFinite()) return false;
  return sigma_velocity(s.x, s.P) < kMostVelocity && sigma_tilt(s.x, s.P) < kMostTilt;
}

}  // namespace epiline
