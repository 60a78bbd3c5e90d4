#include "pipeline/stages/gyro_rotation.h"

#include <algorithm>
#include <cmath>

#include "estimator/geometry/so3.h"

namespace epiline {

void GyroRotation::add(const ImuSample& sample) noexcept {
  const auto& w = sample.angular_velocity_rad_s;
  if (!std::isfinite(w[0]) || !std::isfinite(w[1]) || !std::isfinite(w[2])) return;
  if (size_ > 0 && sample.stamp <= at(size_ - 1).stamp) return;
  if (size_ == kCapacity) {
    first_ = (first_ + 1) % kCapacity;
    --size_;
  }
  readings_[(first_ + size_) % kCapacity] = {sample.stamp, Vec3(w[0], w[1], w[2])};
  ++size_;
}

Vec3 GyroRotation::rate_between(std::size_t i, HostStamp stamp) const {
  const Reading &a = at(i), &b = at(i + 1);
  const double u = (stamp - a.stamp).seconds() / (b.stamp - a.stamp).seconds();
  return (1 - u) * a.rate_rad_s + u * b.rate_rad_s;
}

Mat3 GyroRotation::between(HostStamp from, HostStamp to, const Vec3& bias_rad_s) const noexcept {
  Mat3 R = Mat3::Identity();
  if (size_ < 2) return R;
  std::size_t i = size_ - 1;  // from the newest back: the interval is a recent one
  while (i > 0 && at(i).stamp > from) --i;
  for (; i + 1 < size_ && at(i).stamp < to; ++i) {
    const HostStamp begin = std::max(from, at(i).stamp), end = std::min(to, at(i + 1).stamp);
    if (end <= begin) continue;
    const Vec3 rate = 0.5 * (rate_between(i, begin) + rate_between(i, end)) - bias_rad_s;
    R = R * so3_exp(rate * (end - begin).seconds());
  }
  const Reading& last = at(size_ - 1);
  const Span held = std::min(to - std::max(from, last.stamp), last.stamp - at(size_ - 2).stamp);
  if (held > Span{}) R = R * so3_exp((last.rate_rad_s - bias_rad_s) * held.seconds());
  return R;
}

}  // namespace epiline
