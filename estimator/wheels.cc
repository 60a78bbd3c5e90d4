#include <algorithm>
#include <cmath>

#include "estimator/factors/wheel.h"
#include "estimator/impl.h"

namespace epiline {

namespace {
constexpr Span kMotionSpan = Span::from_milliseconds(500);
constexpr int kFewestSpeeds = 3;
constexpr double kTurns = 4;           // of the mean's sigma
constexpr double kNoiseShare = 0.01;   // of one reading
constexpr double kBendVariance = 1.5;  // of a speed less the mean of its neighbours, where a speed's is 1
}  // namespace

bool Estimator::Impl::add_wheel(const WheelSample& sample) {
  const bool taken = config.wheel.use && wheel.push(sample.stamp, sample.forward_speed_m_s);
  ++(taken ? stats.wheel_samples : stats.wheel_refused);
  if (taken) learn_wheel_noise();
  return taken;
}

/// What three speeds in a row are off a line is noise: at least so much of it there is.
void Estimator::Impl::learn_wheel_noise() {
  const double off = wheel.bend();
  wheel_variance += kNoiseShare * (off * off / kBendVariance - wheel_variance);
  window.wheel.sigma_m_s = std::max(config.wheel.sigma_m_s, std::sqrt(wheel_variance));
}

/// Intervals with speeds around all of their time get their way, once; the last of these speeds may come after the
/// frame.
void Estimator::Impl::attach_wheel() {
  if (!wheel.any()) return;
  for (int k = 1; k < window.size(); ++k) {
    Slot& s = window.at(k);
    if (s.wheel.known || s.wheel.mixed) continue;
    if (integrate_way(wheel, history, window.at(k - 1).time, s.time, window.wheel.forward_B, s.imu.b_g, s.imu.scale,
                      s.wheel))
      ++stats.wheel_frames;
  }
}

void Estimator::Impl::find_wheel_slips() {
  const int k = window.size() - 3;
  const bool knew = k > 0 && window.at(k).wheel.slips;
  find_slips(window);
  if (k > 0 && window.at(k).wheel.slips && !knew) ++stats.wheel_slips;
}

/// Of the frame before the newest, whose way is complete unless the speeds come late.
void Estimator::Impl::watch_wheels() {
  const int k = window.size() - 2;
  if (k < 1 || !window.at(k).wheel.known) return;
  const Slot &from = window.at(k - 1), &to = window.at(k);
  const Vec3& e = window.wheel.forward_B;
  const Vec3 e_W = to.x.R * e;
  const AlongWay along = along_way(window, k);
  wheel_watch.add({.dt_s = to.imu.T,
                   .read_m_s = along.read / to.imu.T,
                   .true_m_s = along.moved / to.imu.T,
                   .gained_m_s2 = (e_W.dot(to.x.v) - (from.x.R * e).dot(from.x.v)) / to.imu.T,
                   .variance_true = e_W.dot(carried.P.block<3, 3>(6, 6) * e_W),
                   .variance_read = window.wheel.sigma_m_s * window.wheel.sigma_m_s * to.wheel.time_of_one_s2 /
                                    (to.imu.T * to.imu.T)});
}

/// Wheels that are known not to turn with the vehicle say nothing.
WheelMotion Estimator::Impl::wheel_motion() const {
  const HostStamp now = window.newest().time;
  const ScalarHistory::Mean speed = wheel.mean(now - kMotionSpan, now);
  if (speed.count < kFewestSpeeds || wheel_watch.is_stuck()) return WheelMotion::kUnknown;
  const double sigma = window.wheel.sigma_m_s / std::sqrt(speed.count);
  return std::abs(speed.value) > kTurns * sigma ? WheelMotion::kTurn : WheelMotion::kStand;
}

}  // namespace epiline
