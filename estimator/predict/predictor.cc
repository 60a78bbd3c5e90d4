#include "estimator/predict/predictor.h"

#include <algorithm>
#include <cmath>

#include "estimator/geometry/so3.h"
#include "estimator/predict/moved_in_time.h"

namespace epiline {

namespace {

using OdometryCovariance = Eigen::Matrix<double, 16, 16, Eigen::RowMajor>;

constexpr double kQuaternionTolerance = 1e-3;
constexpr Span kLongestRevised{1'000'000'000};

template <class Array>
bool finite(const Array& numbers) {
  return std::all_of(numbers.begin(), numbers.end(), [](double x) { return std::isfinite(x); });
}

bool usable(const Odometry& o) {
  if (!finite(o.p_WB_m) || !finite(o.q_WB) || !finite(o.v_WB_m_s) || !finite(o.omega_B_rad_s)) return false;
  if (!finite(o.accelerometer_bias_m_s2) || !finite(o.gyroscope_bias_rad_s) || !finite(o.covariance)) return false;
  if (!finite(o.imu_scale)) return false;
  const double norm = Eigen::Map<const Eigen::Vector4d>(o.q_WB.data()).norm();
  return std::abs(norm - 1) < kQuaternionTolerance && std::abs(o.time_offset_s) < 1;
}

// The instant of the state behind a solved odometry; `set_base` undoes the move of pose and velocity to the image's
// stamp.
HostStamp imu_time(const Odometry& solved) { return solved.stamp + Span::from_seconds(solved.time_offset_s); }

}  // namespace

PredictorConfig predictor_config(const EstimatorConfig& estimator) noexcept {
  PredictorConfig c;
  c.density.noise = in_flight(estimator, estimator.imu);
  return c;
}

ImuHistory::Push Predictor::add_imu(const ImuSample& sample) noexcept {
  ++stats_.imu_samples;
  const bool first = history_.empty();
  const HostStamp before = first ? sample.stamp : history_.newest().stamp;
  const ImuHistory::Push push = history_.push(sample);
  stats_.imu_out_of_order += push == ImuHistory::Push::kOutOfOrder;
  stats_.imu_duplicate += push == ImuHistory::Push::kDuplicate;
  stats_.imu_not_finite += push == ImuHistory::Push::kNotFinite;
  stats_.imu_impossible += push == ImuHistory::Push::kImpossible;
  stats_.imu_far_ahead += push == ImuHistory::Push::kFarAhead;
  if (push != ImuHistory::Push::kTaken) return push;
  if (started_) extend(before);
  if (waiting_ && imu_time(waiting_for_readings_) <= sample.stamp) {
    waiting_ = false;
    apply(waiting_for_readings_, imu_time(waiting_for_readings_));
  }
  return push;
}

/// Over the newest reading. Once a verdict on readings is final, all since the base are integrated anew, unless they
/// are so many that the covariance has long outgrown what one reading may have done.
void Predictor::extend(HostStamp before) noexcept {
  const HostStamp newest = history_.newest().stamp;
  const auto revised = history_.take_revised();
  if (revised && newest - base_time_ < kLongestRevised) {
    interval_.reset(base_.b_a, base_.b_g, scale());
    before = base_time_;
  }
  history_.integrate(before, newest, config_.density, interval_);
}

Predictor::Correction Predictor::correct(const Odometry& solved) noexcept {
  if (!usable(solved)) {
    ++stats_.not_finite;
    return Correction::kNotFinite;
  }
  const HostStamp time = imu_time(solved);
  if (started_ && time <= base_time_) {
    ++stats_.old;
    return Correction::kOld;
  }
  if (history_.empty() || history_.newest().stamp < time) {
    ++stats_.deferred;
    waiting_ = true;
    waiting_for_readings_ = solved;
    return Correction::kDeferred;
  }
  waiting_ = false;
  return apply(solved, time);
}

Predictor::Correction Predictor::apply(const Odometry& solved, HostStamp time) noexcept {
  if (history_.oldest_stamp() > time) {
    ++stats_.no_readings;
    return Correction::kNoReadings;
  }
  const bool announced = !started_ || solved.reset_counter != solved_.reset_counter;
  const NavState before = predicted();
  const Offset left = offset();
  set_base(solved, time);
  started_ = true;

  const NavState x = predicted();
  Offset difference{.p = before.p + left.p - x.p,
                    .phi = so3_log(so3_exp(left.phi) * before.R * x.R.transpose()),
                    .v = before.v + left.v - x.v};
  const bool small = is_small(difference), blended = !announced && small && config_.blend_s > 0;
  large_corrections_ += !announced && !small;
  offset_ = blended ? difference : Offset{};
  offset_time_ = history_.newest().stamp;
  ++stats_.corrections;
  stats_.jumps += !blended;
  return blended ? Correction::kBlended : Correction::kJumped;
}

void Predictor::set_base(const Odometry& solved, HostStamp time) noexcept {
  solved_ = solved;
  base_time_ = time;
  const Eigen::Quaterniond q(solved.q_WB[0], solved.q_WB[1], solved.q_WB[2], solved.q_WB[3]);
  NavState x;
  x.p = Vec3(solved.p_WB_m.data());
  x.v = Vec3(solved.v_WB_m_s.data());
  x.R = q.normalized().toRotationMatrix();
  x.b_a = Vec3(solved.accelerometer_bias_m_s2.data());
  x.b_g = Vec3(solved.gyroscope_bias_rad_s.data());
  base_ = moved_in_time(history_, scale(), x, solved.stamp, time);

  base_covariance_ = into_body(Eigen::Map<const OdometryCovariance>(solved.covariance.data()), base_.R);
  interval_.reset(base_.b_a, base_.b_g, scale());
  history_.integrate(time, history_.newest().stamp, config_.density, interval_);
}

ImuScale Predictor::scale() const noexcept { return {solved_.imu_scale[0], solved_.imu_scale[1]}; }

NavState Predictor::predicted() const noexcept {
  NavState x = base_;
  const double T = interval_.T;
  x.p += base_.v * T + 0.5 * kGravity_W * T * T + base_.R * interval_.dp;
  x.v += kGravity_W * T + base_.R * interval_.dv;
  x.R = base_.R * interval_.dR;
  return x;
}

Predictor::Offset Predictor::offset() const noexcept {
  if (!started_ || config_.blend_s <= 0) return {};
  const double k = std::exp(-(history_.newest().stamp - offset_time_).seconds() / config_.blend_s);
  return {.p = k * offset_.p, .phi = k * offset_.phi, .v = k * offset_.v};
}

bool Predictor::is_small(const Offset& d) const noexcept {
  return d.p.norm() <= config_.blend_most_m && d.phi.norm() <= config_.blend_most_rad &&
         d.v.norm() <= config_.blend_most_m_s;
}

void Predictor::clear() noexcept {
  started_ = waiting_ = false;
  offset_ = {};
}

double Predictor::age_s() const noexcept { return started_ ? (history_.newest().stamp - base_time_).seconds() : 0; }

Predictor::State Predictor::state() const noexcept {
  if (!started_) return State::kWaiting;
  const double age = age_s();
  if (age > config_.stale_after_s) return State::kStale;
  return age > config_.coasting_after_s ? State::kCoasting : State::kCurrent;
}

Odometry Predictor::odometry() const noexcept {
  if (!started_) return {};
  Odometry out = solved_;
  out.reset_counter += large_corrections_;
  const NavState x = predicted();
  const Offset d = offset();
  const ImuHistory::Reading newest = history_.newest();
  const Eigen::Quaterniond q(so3_exp(d.phi) * x.R);
  out.stamp = newest.stamp;
  Eigen::Map<Vec3>(out.p_WB_m.data()) = x.p + d.p;
  out.q_WB = {q.w(), q.x(), q.y(), q.z()};
  Eigen::Map<Vec3>(out.v_WB_m_s.data()) = x.v + d.v;
  Eigen::Map<Vec3>(out.omega_B_rad_s.data()) = (1 + scale().gyroscope) * (newest.w - x.b_g);

  StateCovariance P = carried_on(base_covariance_, base_.R, interval_);
  // The published state is off the predicted one by a known e: its mean square error is P + e e^T.
  Vec9 e;
  e << d.p, x.R.transpose() * d.phi, d.v;
  P.topLeftCorner<9, 9>() += e * e.transpose();
  Eigen::Map<OdometryCovariance>(out.covariance.data()) = P;

  const State now = state();
  if (now == State::kStale) {
    out.health.state = HealthState::kLost;
    out.health.quality = -1;
  } else if (now == State::kCoasting && out.health.state == HealthState::kTracking) {
    out.health.state = HealthState::kDegraded;
  }
  if (now != State::kCurrent) out.health.reasons |= static_cast<std::uint32_t>(HealthReason::kDeadlineMissed);
  return out;
}

}  // namespace epiline
