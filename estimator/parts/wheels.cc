#include "estimator/parts/wheels.h"

#include <algorithm>
#include <cmath>

#include "estimator/factors/wheel.h"

namespace epiline {

namespace {
constexpr Span kMotionSpan = Span::from_milliseconds(500);
constexpr int kFewestSpeeds = 3;
constexpr double kTurns = 4;           // of the mean's sigma
constexpr double kNoiseShare = 0.01;   // of one reading
constexpr double kBendVariance = 1.5;  // of a speed less the mean of its neighbours, where a speed's is 1
}  // namespace

bool Wheels::add(const WheelSample& sample) {
  const bool taken = common_.config.wheel.use && readings_.push(sample.stamp, sample.forward_speed_m_s);
  ++(taken ? common_.stats.wheel_samples : common_.stats.wheel_refused);
  if (taken) learn_noise();
  return taken;
}

/// What three speeds in a row are off a line is noise: at least so much of it there is.
void Wheels::learn_noise() {
  const double off = readings_.bend();
  variance_ += kNoiseShare * (off * off / kBendVariance - variance_);
  common_.window.wheel.sigma_m_s = std::max(common_.config.wheel.sigma_m_s, std::sqrt(variance_));
}

void Wheels::attach() {
  if (!readings_.any()) return;
  Window& window = common_.window;
  for (int k = 1; k < window.size(); ++k) {
    Slot& s = window.at(k);
    if (s.wheel.known || s.wheel.mixed) continue;
    if (integrate_way(readings_, common_.history, window.at(k - 1).time, s.time, window.wheel.forward_B, s.imu.b_g,
                      s.imu.scale, s.wheel))
      ++common_.stats.wheel_frames;
  }
}

void Wheels::find_slips() {
  Window& window = common_.window;
  const int k = window.size() - 3;
  const bool knew = k > 0 && window.at(k).wheel.slips;
  epiline::find_slips(window);
  if (k > 0 && window.at(k).wheel.slips && !knew) ++common_.stats.wheel_slips;
}

/// Of the frame before the newest, whose way is complete unless the speeds come late.
void Wheels::watch() {
  const Window& window = common_.window;
  const int k = window.size() - 2;
  if (k < 1 || !window.at(k).wheel.known) return;
  const Slot &from = window.at(k - 1), &to = window.at(k);
  const Vec3& e = window.wheel.forward_B;
  const Vec3 e_W = to.x.R * e;
  const AlongWay along = along_way(window, k);
  watch_.add({.dt_s = to.imu.T,
              .read_m_s = along.read / to.imu.T,
              .true_m_s = along.moved / to.imu.T,
              .gained_m_s2 = (e_W.dot(to.x.v) - (from.x.R * e).dot(from.x.v)) / to.imu.T,
              .variance_true = e_W.dot(common_.carried.P.block<3, 3>(6, 6) * e_W),
              .variance_read =
                  window.wheel.sigma_m_s * window.wheel.sigma_m_s * to.wheel.time_of_one_s2 / (to.imu.T * to.imu.T)});
}

WheelMotion Wheels::motion() const {
  const HostStamp now = common_.window.newest().time;
  const ScalarHistory::Mean speed = readings_.mean(now - kMotionSpan, now);
  if (speed.count < kFewestSpeeds || watch_.is_stuck()) return WheelMotion::kUnknown;
  const double sigma = common_.window.wheel.sigma_m_s / std::sqrt(speed.count);
  return std::abs(speed.value) > kTurns * sigma ? WheelMotion::kTurn : WheelMotion::kStand;
}

std::optional<Wheels::Speed> Wheels::speed_of(const Slot& frame) const {
  double read = 0;
  if (!readings_.at(frame.time, read)) return std::nullopt;
  const WheelModel& model = common_.window.wheel;
  return Speed{read - model.forward_B.dot((frame.omega - frame.x.b_g).cross(model.p_BV)),
               1 / (model.sigma_m_s * model.sigma_m_s + model.scale_sigma * model.scale_sigma * read * read)};
}

}  // namespace epiline
