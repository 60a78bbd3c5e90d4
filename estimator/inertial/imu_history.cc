#include "estimator/inertial/imu_history.h"

#include <algorithm>
#include <cmath>

namespace epiline {

namespace {
constexpr double kGapPeriods = 2.5;
constexpr double kNeverAGap = 0.004;  // s; jitter of fast sensors
constexpr double kDistrustedTime_s = 1;
}  // namespace

ImuHistory::Push ImuHistory::push(const ImuSample& s) {
  const Reading r{s.stamp, Vec3(s.angular_velocity_rad_s.data()), Vec3(s.specific_force_m_s2.data()),
                  (s.reasons & kDistrustReasons) != 0};
  if (!r.w.allFinite() || !r.a.allFinite()) return Push::kNotFinite;
  after_gap_ = false;
  if (count_ > 0) {
    const double dt = (r.stamp - newest().stamp).seconds();
    if (dt < 0) return Push::kOutOfOrder;
    if (dt == 0) return Push::kDuplicate;
    const double gap = std::max(kNeverAGap, kGapPeriods * period_);
    after_gap_ = period_ > 0 && dt > gap;
    // A gap counts as the shortest one: a period learnt from a burst must be able to grow.
    period_ = period_ > 0 ? 0.95 * period_ + 0.05 * std::min(dt, gap) : dt;
  }
  readings_[count_++ % kCapacity] = r;
  return Push::kTaken;
}

std::uint64_t ImuHistory::before(HostStamp t) const {
  std::uint64_t lo = first(), hi = count_;  // at(lo) <= t < at(hi), where they exist
  while (hi - lo > 1) {
    const std::uint64_t mid = lo + (hi - lo) / 2;
    (at(mid).stamp <= t ? lo : hi) = mid;
  }
  return lo;
}

ImuHistory::Reading ImuHistory::interpolated(std::uint64_t i, HostStamp t) const {
  const Reading& a = at(i);
  if (i + 1 >= count_ || t <= a.stamp) return {t, a.w, a.a, a.distrusted};
  const Reading& b = at(i + 1);
  const double u = static_cast<double>((t - a.stamp).ns) / static_cast<double>((b.stamp - a.stamp).ns);
  return {t, a.w + u * (b.w - a.w), a.a + u * (b.a - a.a), a.distrusted || b.distrusted};
}

template <class F>
void ImuHistory::pieces(HostStamp t0, HostStamp t1, F&& visit) const {
  std::uint64_t i = before(t0);
  Reading from = interpolated(i, t0);
  while (from.stamp < t1) {
    const bool inner = i + 1 < count_ && at(i + 1).stamp < t1;
    const Reading to = inner ? at(i + 1) : interpolated(i, t1);
    if (to.stamp > from.stamp) visit(from, to, (to.stamp - from.stamp).seconds());
    if (!inner) break;
    from = to;
    ++i;
  }
}

double ImuHistory::longest_unknown_s(HostStamp t0, HostStamp t1) const {
  if (count_ == 0) return 0;
  std::uint64_t i = before(t0);
  while (i > first() && at(i).distrusted) --i;
  HostStamp trusted = at(i).stamp;
  double longest = 0;
  while (++i < count_ && trusted < t1) {
    longest = std::max(longest, (at(i).stamp - trusted).seconds());
    if (!at(i).distrusted) trusted = at(i).stamp;
  }
  return longest;
}

bool ImuHistory::reaches(HostStamp t) const {
  return count_ > 0 && t - newest().stamp <= Span::from_seconds(std::max(kNeverAGap, kGapPeriods * period_));
}

bool ImuHistory::integrate(HostStamp t0, HostStamp t1, const Density& density, Preintegration& out) const {
  constexpr Span kReach{500'000'000};
  if (count_ == 0 || newest().stamp + kReach < t1 || t0 + kReach < oldest_stamp()) return false;
  const double gap = std::max(kNeverAGap, kGapPeriods * period_);
  pieces(t0, t1, [&](const Reading& a, const Reading& b, double dt) {
    ImuNoise noise = density.noise;
    // What happens across a hole, beyond the newest reading or at a limit is unknown for all that time, not anew at
    // each step: the time it lasts is in the density.
    double unknown_s = period_ > 0 && dt > gap ? dt : 0;
    if (b.stamp > newest().stamp && (b.stamp - newest().stamp).seconds() > gap)
      unknown_s = std::max(unknown_s, (b.stamp - newest().stamp).seconds());
    if (a.distrusted || b.distrusted) unknown_s = std::max(unknown_s, kDistrustedTime_s);
    if (unknown_s > 0) {
      const double root = std::sqrt(unknown_s);
      noise.accelerometer_density = std::max(noise.accelerometer_density, density.gap_acceleration * root);
      noise.gyroscope_density = std::max(noise.gyroscope_density, density.gap_rate * root);
    }
    out.integrate(a.w, a.a, b.w, b.a, dt, noise);
  });
  return true;
}

void ImuHistory::propagate(HostStamp t0, HostStamp t1, NavState& x, Vec3& omega) const {
  if (count_ == 0) return;
  omega = interpolated(before(t1), t1).w;
  pieces(t0, t1, [&](const Reading& a, const Reading& b, double dt) {
    const Mat3 R1 = x.R * so3_exp((0.5 * (a.w + b.w) - x.b_g) * dt);
    const Vec3 acceleration = 0.5 * (x.R * (a.a - x.b_a) + R1 * (b.a - x.b_a)) + kGravity_W;
    x.p += x.v * dt + 0.5 * acceleration * dt * dt;
    x.v += acceleration * dt;
    x.R = R1;
  });
}

double ImuHistory::mean_rate(HostStamp t0, HostStamp t1, const Vec3& b_g) const {
  double sum = 0;
  int n = 0;
  each(t0, t1, [&](const Reading& r) {
    sum += (r.w - b_g).norm();
    ++n;
  });
  return n > 0 ? sum / n : 0;
}

}  // namespace epiline
