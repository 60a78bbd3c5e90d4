#include "estimator/inertial/scalar_history.h"

#include <cmath>

namespace epiline {

bool ScalarHistory::push(HostStamp stamp, double value) noexcept {
  if (!std::isfinite(value)) return false;
  if (pushed_ > 0 && stamp <= back(0).stamp) return false;
  readings_[pushed_++ % kMost] = {stamp, value};
  return true;
}

std::size_t ScalarHistory::after(HostStamp stamp) const noexcept {
  std::size_t i = 0;
  while (i < count() && back(i).stamp > stamp) ++i;
  return i > 0 ? i - 1 : count();
}

bool ScalarHistory::at(HostStamp stamp, double& value) const noexcept {
  const std::size_t later = after(stamp), before = later < count() ? later + 1 : 0;
  if (before >= count()) return false;
  value = back(before).value;
  if (back(before).stamp == stamp) return true;
  if (later >= count()) return false;
  const Span between = back(later).stamp - back(before).stamp;
  if (between > longest_) return false;
  value += (stamp - back(before).stamp).seconds() / between.seconds() * (back(later).value - value);
  return true;
}

ScalarHistory::Mean ScalarHistory::mean(HostStamp t0, HostStamp t1) const noexcept {
  Mean m;
  for (std::size_t i = 0; i < count() && back(i).stamp >= t0; ++i) {
    if (back(i).stamp > t1) continue;
    m.value += (back(i).value - m.value) / ++m.count;
  }
  return m;
}

}  // namespace epiline
