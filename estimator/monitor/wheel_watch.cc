#include "estimator/monitor/wheel_watch.h"

#include <algorithm>
#include <cmath>

namespace epiline {

namespace {
constexpr double kSpeedMemory_s = 8, kEnough_s = 5;
constexpr double kSlow_m_s = 0.1;     // below, nothing is said
constexpr double kSteady_m_s2 = 0.1;  // accelerations of no use for a delay
constexpr double kSame_s = 1;         // the wheels may be stuck: wait for that verdict
constexpr double kSame_m_s = 1e-3;    // the same reading again
constexpr double kStuckSpread = 0.3;  // m/s, of the vehicle's speed meanwhile
constexpr double kSpreadSigmas = 4;
constexpr double kScaleOff = 0.015, kScaleSigmas = 2.5;  // relative: worth a word beyond; tyres err by a percent
constexpr double kScatter = 0.07;                        // of the speeds
constexpr double kLeastAlone = 0.1;  // of what is known of the speed: less is the wheels' word against itself
constexpr double kLeast_s = 0.05, kByDelay = 0.25;  // what of the scatter's square is left by a delay that explains it
}  // namespace

void WheelWatch::watch_stuck(const Interval& i) noexcept {
  if (std::abs(i.read_m_s - z_) > kSame_m_s) {
    z_ = i.read_m_s;
    least_ = most_ = i.true_m_s;
    same_s_ = 0;
    stuck_ = false;
  }
  same_s_ += i.dt_s;
  least_ = std::min(least_, i.true_m_s);
  most_ = std::max(most_, i.true_m_s);
  if (most_ - least_ < std::max(kStuckSpread, kSpreadSigmas * std::sqrt(i.variance_true))) return;
  stuck_ = true;
  found_[index(Suspect::kWheelStuck)] = {Severity::kNote, z_, {}};
}

void WheelWatch::add(const Interval& i) noexcept {
  watch_stuck(i);
  const double keep = std::exp(-i.dt_s / kSpeedMemory_s);
  const auto sum = [&](double& of, double value) { of = keep * of + i.dt_s * value; };
  sum(time_s_, 1);
  sum(zz_, i.read_m_s * i.read_m_s);
  sum(zu_, i.read_m_s * i.true_m_s);
  sum(uu_, i.true_m_s * i.true_m_s);
  sum(za_, i.read_m_s * i.gained_m_s2);
  sum(ua_, i.true_m_s * i.gained_m_s2);
  sum(aa_, i.gained_m_s2 * i.gained_m_s2);
  sum(noise_true_, i.variance_true);
  sum(noise_read_, i.variance_read);
  if (time_s_ > kEnough_s && std::min(zz_, uu_) > kSlow_m_s * kSlow_m_s * time_s_ && !stuck_) fit();
}

/// z = scale u, or scale (u - delay a).
void WheelWatch::fit() noexcept {
  const auto say = [&](Suspect s, double figure) { found_[index(s)] = {Severity::kNote, figure, {}}; };
  const double aa = aa_ + kSteady_m_s2 * kSteady_m_s2 * time_s_, det = uu_ * aa - ua_ * ua_;
  const double scale = (zu_ * aa - za_ * ua_) / det, by_a = (za_ * uu_ - zu_ * ua_) / det, delay_s = -by_a / scale;
  const double left = zz_ - zu_ * zu_ / uu_, left_by_both = zz_ - scale * zu_ - by_a * za_;
  if (left > kScatter * kScatter * zz_ + 2 * noise_read_) {
    if (left_by_both < kByDelay * left && delay_s > kLeast_s)
      say(Suspect::kWheelDelay, delay_s);
    else if (same_s_ < kSame_s)
      say(Suspect::kWheelSlip, std::sqrt(left / zz_));
    return;
  }
  // The vehicle's speed was estimated with these wheels, as right to scale_sigma_; taken out, the rest says more.
  const double off = 1 / scale - 1, variance = noise_true_ / uu_;
  const double alone = variance / std::max(1 - variance / (scale_sigma_ * scale_sigma_), kLeastAlone);
  if (std::abs(off) * alone / variance > std::max(kScaleOff, kScaleSigmas * std::sqrt(alone)))
    say(Suspect::kWheelScale, 1 + off);
}

void add_suspicions(const WheelWatch& watch, Suspicions& s) noexcept {
  for (const Suspect suspect : {Suspect::kWheelScale, Suspect::kWheelSlip, Suspect::kWheelStuck, Suspect::kWheelDelay})
    s[static_cast<std::size_t>(suspect)] = watch[suspect];
}

}  // namespace epiline
