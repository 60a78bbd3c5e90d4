#include "estimator/inertial/imu_history.h"

#include <algorithm>
#include <cmath>

namespace epiline {

namespace {
constexpr double kDistrustedTime_s = 1;
// A step ahead that only a second reading makes credible: in a longer silence the motion is lost anyway (health.md).
constexpr Span kFarAhead = Span::from_milliseconds(250);

SpikeJudge::Unknown unknown_of(const ImuHistory::Reading& r) { return r.suspect ? r.unknown : SpikeJudge::Unknown{}; }

SpikeJudge::Unknown larger(const SpikeJudge::Unknown& x, const SpikeJudge::Unknown& y) {
  return {std::max(x.rate_rad_s, y.rate_rad_s), std::max(x.force_m_s2, y.force_m_s2)};
}

/// A value that is off by s changes the integral over the two periods beside it by s times a period: half the variance
/// is for each of them.
double density_of(double s, double period) { return s * std::sqrt(0.5 * period); }
}  // namespace

void ImuHistory::clear() {
  count_ = 0;
  period_ = {};
  judge_.clear();
  has_aside_ = false;
}

ImuHistory::Push ImuHistory::push(const ImuSample& s) {
  const Reading r{s.stamp, Vec3(s.angular_velocity_rad_s.data()), Vec3(s.specific_force_m_s2.data()),
                  (s.reasons & kDistrustReasons) != 0};
  if (!r.w.allFinite() || !r.a.allFinite()) return Push::kNotFinite;
  if (is_impossible(r.w, r.a)) return Push::kImpossible;
  if (count_ == 1 && newest_stamp() - r.stamp > kFarAhead) clear();  // one of two stamps is wrong: the third tells
  if (count_ > 0) {
    const Span step = r.stamp - newest_stamp();
    if (step.ns < 0) return Push::kOutOfOrder;
    if (step.ns == 0) return Push::kDuplicate;
    if (step > kFarAhead) {
      const bool confirmed = has_aside_ && r.stamp > aside_.stamp && r.stamp - aside_.stamp <= kFarAhead;
      if (!confirmed) {
        aside_ = r;
        has_aside_ = true;
        return Push::kFarAhead;
      }
      take(aside_);
      const bool after_gap = after_gap_;
      take(r);
      after_gap_ = after_gap;
      return Push::kTaken;
    }
  }
  take(r);
  return Push::kTaken;
}

void ImuHistory::take(Reading r) {
  has_aside_ = false;
  after_gap_ = period_.step(r.stamp);
  judge(r);
  readings_[count_++ % kCapacity] = r;
}

void ImuHistory::judge(Reading& r) {
  const SpikeJudge::Verdict v = judge_.step(r.stamp, r.w, r.a, after_gap_);
  r.suspect = v.suspect;
  r.unknown = v.unknown;
  if (v.suspect) ++counts_.suspects;
  if (v.past == SpikeJudge::Past::kOpen) return;
  const auto past = std::min(static_cast<std::uint64_t>(v.past_count), count_ - first());
  for (std::uint64_t i = count_ - past; i < count_; ++i) {
    Reading& suspect = at(i);
    suspect.suspect = v.past != SpikeJudge::Past::kReal;
    suspect.in_gap = v.past == SpikeJudge::Past::kGap;
    suspect.unknown = v.unknown;
    // what the watch said of a value that is not used
    if (v.past == SpikeJudge::Past::kSpikes) suspect.distrusted = false;
  }
  if (v.past == SpikeJudge::Past::kSpikes) counts_.bridged += past;
  if (v.past == SpikeJudge::Past::kGap) ++counts_.gaps;
  after_gap_ = after_gap_ || v.past == SpikeJudge::Past::kGap;
  if (v.base_is_spike && count_ - past > first()) {
    Reading& base = at(count_ - past - 1);
    base.suspect = true;
    base.unknown = v.unknown;
    ++counts_.bridged;
  }
}

ImuHistory::Reading ImuHistory::value(std::uint64_t i) const {
  Reading r = at(i);
  if (!r.suspect) return r;
  std::uint64_t before = i, after = i;
  while (before > first() && at(before).suspect) --before;
  while (after + 1 < count_ && at(after).suspect) ++after;
  if (at(before).suspect) before = after;
  if (at(after).suspect) after = before;
  const Reading &a = at(before), &b = at(after);
  const double u = before == after ? 0 : (r.stamp - a.stamp).seconds() / (b.stamp - a.stamp).seconds();
  r.w = a.w + u * (b.w - a.w);
  r.a = a.a + u * (b.a - a.a);
  return r;
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
  Reading a = value(i);
  const HostStamp begin = a.stamp;
  a.stamp = t;
  if (i + 1 >= count_ || t <= begin) return a;
  const Reading b = value(i + 1);
  const double u = static_cast<double>((t - begin).ns) / static_cast<double>((b.stamp - begin).ns);
  a.w += u * (b.w - a.w);
  a.a += u * (b.a - a.a);
  a.distrusted = a.distrusted || b.distrusted;
  a.unknown = larger(unknown_of(a), unknown_of(b));
  a.suspect = a.suspect || b.suspect;
  return a;
}

template <class F>
void ImuHistory::pieces(HostStamp t0, HostStamp t1, F&& visit) const {
  std::uint64_t i = before(t0);
  Reading from = interpolated(i, t0);
  while (from.stamp < t1) {
    const bool inner = i + 1 < count_ && at(i + 1).stamp < t1;
    const Reading to = inner ? value(i + 1) : interpolated(i, t1);
    if (to.stamp > from.stamp) visit(from, to, (to.stamp - from.stamp).seconds());
    if (!inner) break;
    from = to;
    ++i;
  }
}

double ImuHistory::longest_unknown_s(HostStamp t0, HostStamp t1) const {
  if (count_ == 0) return 0;
  std::uint64_t i = before(t0);
  const auto no_use = [this](std::uint64_t k) { return at(k).distrusted || at(k).in_gap; };
  while (i > first() && no_use(i)) --i;
  HostStamp trusted = at(i).stamp;
  double longest = 0;
  while (++i < count_ && trusted < t1) {
    longest = std::max(longest, (at(i).stamp - trusted).seconds());
    if (!no_use(i)) trusted = at(i).stamp;
  }
  return longest;
}

bool ImuHistory::reaches(HostStamp t) const {
  return count_ > 0 && t - newest_stamp() <= Span::from_seconds(period_.hole_s());
}

bool ImuHistory::integrate(HostStamp t0, HostStamp t1, const Density& density, Preintegration& out) const {
  constexpr Span kReach{500'000'000};
  if (count_ == 0 || newest_stamp() + kReach < t1 || t0 + kReach < oldest_stamp()) return false;
  const double gap = period_.hole_s();
  pieces(t0, t1, [&](const Reading& a, const Reading& b, double dt) {
    ImuNoise noise = density.noise;
    // What happens across a hole, beyond the newest reading or at a limit is unknown for all that time, not anew at
    // each step: the time it lasts is in the density.
    double unknown_s = period() > 0 && dt > gap ? dt : 0;
    if (b.stamp > newest_stamp() && (b.stamp - newest_stamp()).seconds() > gap)
      unknown_s = std::max(unknown_s, (b.stamp - newest_stamp()).seconds());
    if (a.distrusted || b.distrusted) unknown_s = std::max(unknown_s, kDistrustedTime_s);
    if (unknown_s > 0) {
      const double root = std::sqrt(unknown_s);
      noise.accelerometer_density = std::max(noise.accelerometer_density, density.gap_acceleration * root);
      noise.gyroscope_density = std::max(noise.gyroscope_density, density.gap_rate * root);
    }
    if (a.suspect || b.suspect) {
      const SpikeJudge::Unknown unknown = larger(unknown_of(a), unknown_of(b));
      noise.accelerometer_density = std::hypot(noise.accelerometer_density, density_of(unknown.force_m_s2, period()));
      noise.gyroscope_density = std::hypot(noise.gyroscope_density, density_of(unknown.rate_rad_s, period()));
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
