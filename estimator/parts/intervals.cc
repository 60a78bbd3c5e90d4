#include "estimator/parts/intervals.h"

#include <algorithm>
#include <cmath>

#include "estimator/factors/imu.h"

namespace epiline {

namespace {
constexpr double kReintegrateAccelerometer = 0.1, kReintegrateGyroscope = 0.01;  // m/s^2, rad/s
constexpr double kReintegrateScale = 0.005;                                      // relative
constexpr double kBiasStep = 0.1;     // rad/s: as far from zero as before a first start
constexpr int kDoubtedIntervals = 4;  // the newest: older ones have been judged before
constexpr double kAnyRate = 10;       // rad/s, of a vehicle
}  // namespace

bool Intervals::is_silent(HostStamp from, HostStamp to) const {
  return common_.history.longest_unknown_s(from, to) > kLongestUnknown_s;
}

/// The interval between two images without readings: turning and moving as before.
void Intervals::coast(const Slot& from, double T, Preintegration& interval) const {
  const ImuNoise& noise = common_.noise.of_intervals().noise;
  const double rate = kAnyRate * T, walk_a = noise.accelerometer_random_walk, walk_g = noise.gyroscope_random_walk;
  interval.T = T;
  interval.dR = so3_exp(T * (from.omega - from.x.b_g));
  interval.dv = from.x.R.transpose() * (-kGravity_W * T);
  interval.dp = 0.5 * T * interval.dv;
  interval.C.block<3, 3>(3, 3) = rate * rate * Mat3::Identity();
  interval.C.block<3, 3>(9, 9) = walk_a * walk_a * T * Mat3::Identity();
  interval.C.block<3, 3>(12, 12) = walk_g * walk_g * T * Mat3::Identity();
  interval.forget_forces(kAnyAcceleration);
}

bool Intervals::integrate(const Slot& from, Slot& to) const {
  to.silent = to.refused || is_silent(from.time, to.time);
  if (!to.silent) {
    const bool whole = common_.history.integrate(from.time, to.time, common_.noise.of_intervals(), to.imu);
    if (to.forces_doubted) to.imu.doubt_forces(kAnyAcceleration);
    to.imu.doubt_rates(to.unknown_step);
    return whole;
  }
  coast(from, (to.time - from.time).seconds(), to.imu);
  return true;
}

/// The interval that ends at frame k, if the readings reach back to its beginning.
void Intervals::integrate_again(int k, const Vec3& b_a, const Vec3& b_g) {
  const ImuHistory& history = common_.history;
  Window& window = common_.window;
  const HostStamp begin = window.at(k - 1).time;
  if (!window.at(k).imu.knows_motion || history.empty() || history.oldest_stamp() > begin) return;
  Slot anew = window.at(k);
  anew.imu.reset(b_a, b_g, window.calibration.scale);
  if (integrate(window.at(k - 1), anew) && whiten(anew)) window.at(k) = anew;
}

void Intervals::follow_biases() {
  const Window& window = common_.window;
  const ImuScale& scale = window.calibration.scale;
  for (int k = 1; k < window.size(); ++k) {
    const Preintegration& imu = window.at(k).imu;
    const NavState& from = window.at(k - 1).x;
    if ((imu.b_a - from.b_a).norm() > kReintegrateAccelerometer ||
        (imu.b_g - from.b_g).norm() > kReintegrateGyroscope ||
        std::abs(imu.scale.accelerometer - scale.accelerometer) > kReintegrateScale ||
        std::abs(imu.scale.gyroscope - scale.gyroscope) > kReintegrateScale)
      integrate_again(k, from.b_a, from.b_g);
  }
}

void Intervals::follow_readings() {
  const auto revised = common_.history.take_revised();
  if (!revised) return;
  for (int k = 1; k < common_.window.size(); ++k) {
    const Slot& s = common_.window.at(k);
    if (s.time > *revised) integrate_again(k, s.imu.b_a, s.imu.b_g);
  }
}

void Intervals::weigh_anew() {
  for (int k = 1; k < common_.window.size(); ++k)
    integrate_again(k, common_.window.at(k).imu.b_a, common_.window.at(k).imu.b_g);
}

/// A bias that has stepped contradicts all intervals that share it, none of them much. Where it contradicts most, it
/// has stepped; null: it has not, or was let step a moment ago.
Slot* Intervals::where_bias_stepped() {
  Window& window = common_.window;
  double sum = 0, most = 0;
  Slot* worst = nullptr;
  for (int k = std::max(1, window.size() - kDoubtedIntervals); k < window.size(); ++k) {
    if (window.at(k).unknown_step > 0) return nullptr;
    const double chi2 = imu_chi2_of_turn(window, k);
    sum += chi2;
    if (chi2 <= most) continue;
    most = chi2;
    worst = &window.at(k);
  }
  return turn_watch_.persists(sum / kDoubtedIntervals) ? worst : nullptr;
}

Intervals::Doubt Intervals::doubt_contradicted() {
  Window& window = common_.window;
  Doubt doubt;
  Slot* const stepped = where_bias_stepped();
  for (int k = std::max(1, window.size() - kDoubtedIntervals); k < window.size(); ++k) {
    Slot& slot = window.at(k);
    if (slot.only_images() || !watch_.contradicted(imu_chi2(window, k), window.at(k - 1).forces_doubted)) continue;
    slot.forces_doubted = true;
    slot.imu.doubt_forces(kAnyAcceleration);
    whiten(slot);
    doubt.forces = true;
  }
  if (stepped == nullptr) return doubt;
  stepped->imu.doubt_rates(stepped->unknown_step = kBiasStep);
  doubt.bias = whiten(*stepped);
  return doubt;
}

double Intervals::widens(double dt_s) {
  const Window& window = common_.window;
  if (window.size() < 2 || window.newest().only_images()) return 1;
  const double chi2 = imu_chi2(window, window.size() - 1);
  watch_.add(chi2, dt_s);
  turn_watch_.add(imu_chi2_of_turn(window, window.size() - 1), dt_s);
  return watch_.widens(chi2);
}

}  // namespace epiline
