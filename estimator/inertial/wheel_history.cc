#include "estimator/inertial/wheel_history.h"

#include <algorithm>
#include <cmath>

namespace epiline {

bool WheelHistory::push(const WheelSample& sample) noexcept {
  if (!std::isfinite(sample.forward_speed_m_s)) return false;
  if (pushed_ > 0 && sample.stamp <= back(0).stamp) return false;
  readings_[pushed_++ % kMost] = {sample.stamp, sample.forward_speed_m_s};
  return true;
}

bool WheelHistory::speed_at(HostStamp stamp, double& speed_m_s) const noexcept {
  const std::size_t count = std::min(pushed_, kMost);
  for (std::size_t i = 0; i < count; ++i) {
    const Reading& before = back(i);
    if (before.stamp > stamp) continue;
    if (before.stamp == stamp) {
      speed_m_s = before.speed_m_s;
      return true;
    }
    if (i == 0) return false;
    const Reading& after = back(i - 1);
    const Span between = after.stamp - before.stamp;
    if (between > kLongest) return false;
    const double part = (stamp - before.stamp).seconds() / between.seconds();
    speed_m_s = before.speed_m_s + part * (after.speed_m_s - before.speed_m_s);
    return true;
  }
  return false;
}

}  // namespace epiline
