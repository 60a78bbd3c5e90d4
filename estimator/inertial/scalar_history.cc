#include "estimator/inertial/scalar_history.h"

#include <algorithm>
#include <cmath>

namespace epiline {

bool ScalarHistory::push(HostStamp stamp, double value) noexcept {
  if (!std::isfinite(value)) return false;
  if (pushed_ > 0 && stamp <= back(0).stamp) return false;
  readings_[pushed_++ % kMost] = {stamp, value};
  return true;
}

bool ScalarHistory::at(HostStamp stamp, double& value) const noexcept {
  const std::size_t count = std::min(pushed_, kMost);
  for (std::size_t i = 0; i < count; ++i) {
    const Reading& before = back(i);
    if (before.stamp > stamp) continue;
    if (before.stamp == stamp) {
      value = before.value;
      return true;
    }
    if (i == 0) return false;
    const Reading& after = back(i - 1);
    const Span between = after.stamp - before.stamp;
    if (between > longest_) return false;
    const double part = (stamp - before.stamp).seconds() / between.seconds();
    value = before.value + part * (after.value - before.value);
    return true;
  }
  return false;
}

}  // namespace epiline
