#include "pipeline/stages/gyro_rotation.h"

#include <algorithm>

#include "estimator/geometry/so3.h"

namespace epiline {

void GyroRotation::add(const ImuSample& sample) noexcept {
  const Vec3 w(sample.angular_velocity_rad_s.data()), a(sample.specific_force_m_s2.data());
  if (is_impossible(w, a)) return;
  if (size_ > 0 && sample.stamp <= at(size_ - 1).stamp) return;
  if (size_ == kCapacity) {
    first_ = (first_ + 1) % kCapacity;
    --size_;
  }
  const SpikeJudge::Verdict verdict = judge_.step(sample.stamp, w, a, period_.step(sample.stamp));
  settle(verdict);
  at(size_++) = {sample.stamp, w, verdict.suspect};
}

/// What became of the suspects before the newest reading.
void GyroRotation::settle(const SpikeJudge::Verdict& v) noexcept {
  if (v.past == SpikeJudge::Past::kOpen) return;
  const std::size_t past = std::min(static_cast<std::size_t>(v.past_count), size_);
  for (std::size_t i = size_ - past; i < size_; ++i) at(i).suspect = v.past != SpikeJudge::Past::kReal;
  if (v.base_is_spike && size_ > past) at(size_ - past - 1).suspect = true;
}

Vec3 GyroRotation::rate(std::size_t i) const {
  std::size_t before = i, after = i;
  while (before > 0 && at(before).suspect) --before;
  while (after + 1 < size_ && at(after).suspect) ++after;
  if (at(before).suspect) before = after;
  if (at(after).suspect) after = before;
  if (before == after) return at(before).rate_rad_s;
  const Reading &a = at(before), &b = at(after);
  const double u = (at(i).stamp - a.stamp).seconds() / (b.stamp - a.stamp).seconds();
  return a.rate_rad_s + u * (b.rate_rad_s - a.rate_rad_s);
}

Vec3 GyroRotation::rate_between(std::size_t i, HostStamp stamp) const {
  const Reading &a = at(i), &b = at(i + 1);
  const double u = (stamp - a.stamp).seconds() / (b.stamp - a.stamp).seconds();
  return (1 - u) * rate(i) + u * rate(i + 1);
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
  if (held > Span{}) R = R * so3_exp((rate(size_ - 1) - bias_rad_s) * held.seconds());
  return R;
}

}  // namespace epiline
