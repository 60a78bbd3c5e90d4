#include "estimator/inertial/imu_history.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace epiline {

namespace {
constexpr double kDistrustedTime_s = 1;
// A step ahead that only a second reading makes credible: in a longer silence the motion is lost anyway (health.md).
constexpr Span kFarAhead = Span::from_milliseconds(250);
// Departures from the four neighbours, in units of the usual one: those of a reading that is corrupt though the judge
// let it pass, and of an axis of a corrupt reading that is corrupt itself.
constexpr double kCorrupt = 6, kCorruptAxis = 4;
constexpr double kUsual = 0.5;        // of that limit
constexpr double kUnknown = 3;        // times the usual error, of a value surely in the right place
constexpr double kLongestStep = 1.5;  // periods between neighbours
constexpr std::uint64_t kReach = 2;   // neighbours on each side
constexpr int kMostLost = 3;          // in a row
constexpr int kNeverRepeated = 100;   // readings in a row of which none repeats its predecessor

Interpolator::Values values_of(const ImuHistory::Reading& r) {
  return (Interpolator::Values() << r.w.array(), r.a.array()).finished();
}

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
  interpolator_ = {};
  departures_ = {};
  all_differed_ = repeated_ = 0;
  revised_.reset();
  has_aside_ = false;
}

std::optional<HostStamp> ImuHistory::take_revised() { return std::exchange(revised_, std::nullopt); }

/// Integrals that reading i is part of begin to differ at the one before it.
void ImuHistory::revise(std::uint64_t i) {
  const HostStamp from = at(i > first() ? i - 1 : i).stamp;
  if (!revised_ || from < *revised_) revised_ = from;
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
  const bool bridged = count_ > 0 && keep_places(r.stamp);
  if (count_ > 0 && repeats(r)) return keep_place(r.stamp, repeated_);
  judge(r, after_gap_ && !bridged);
  append(r);
}

void ImuHistory::append(const Reading& r) {
  readings_[count_++ % kCapacity] = r;
  look_back();
  if (count_ - first() > 4 * kReach) confirm(count_ - 1 - 2 * kReach);
}

/// A straight line over lost readings leaves out what the vehicle did there, and claims to know it. So each has a place
/// of its own, where it is interpolated as a corrupt one is.
void ImuHistory::keep_place(HostStamp stamp, int in_a_row) {
  Reading r = value(count_ - 1);
  r.stamp = stamp;
  r.distrusted = r.replaced = false;
  r.suspect = r.lost = true;
  r.unknown = judge_.unknown_of_lost(in_a_row);
  append(r);
}

/// False: none was lost, or too many.
bool ImuHistory::keep_places(HostStamp next) {
  if (period() <= 0) return false;
  const HostStamp last = newest_stamp();
  const double step_s = (next - last).seconds();
  const int lost = static_cast<int>(std::lround(step_s / period())) - 1;
  if (lost < 1 || lost > kMostLost) return false;
  for (int k = 1; k <= lost; ++k) keep_place(last + Span::from_seconds(step_s * k / (lost + 1)), lost);
  return true;
}

/// A sensor that hangs sends its last reading again. Noise hardly ever repeats in six values, so where none did before,
/// a few that do are as good as lost. More in a row are for the watch to tell, or a sensor without noise.
bool ImuHistory::repeats(const Reading& r) {
  const bool same = r.w == last_w_ && r.a == last_a_;
  last_w_ = r.w;
  last_a_ = r.a;
  if (same && all_differed_ >= kNeverRepeated && ++repeated_ <= kMostLost) {
    counts_.bridged += repeated_ == 1 ? 0U : repeated_ == 2 ? 2U : 1U;  // a single one may be chance
    return true;
  }
  all_differed_ = same ? 0 : all_differed_ + 1;
  repeated_ = 0;
  return false;
}

/// `unknown_before`: nothing before it is a guide.
void ImuHistory::judge(Reading& r, bool unknown_before) {
  const SpikeJudge::Verdict v = judge_.step(r.stamp, r.w, r.a, unknown_before);
  r.suspect = v.suspect;
  r.unknown = v.unknown;
  if (v.suspect) ++counts_.suspects;
  if (v.past == SpikeJudge::Past::kOpen) return;
  std::uint64_t i = count_;
  for (int left = v.past_count; left > 0 && i > first();) {
    Reading& suspect = at(--i);
    if (suspect.lost) continue;
    --left;
    suspect.suspect = v.past != SpikeJudge::Past::kReal;
    suspect.in_gap = v.past == SpikeJudge::Past::kGap;
    suspect.unknown = v.unknown;
  }
  if (v.past == SpikeJudge::Past::kSpikes) counts_.bridged += static_cast<std::uint64_t>(v.past_count);
  if (v.past == SpikeJudge::Past::kGap) ++counts_.gaps;
  after_gap_ = after_gap_ || v.past == SpikeJudge::Past::kGap;
  revise(i);
  while (i > first() && at(i - 1).lost) --i;
  if (v.base_is_spike && i > first()) {
    revise(i - 1);
    Reading& base = at(i - 1);
    base.suspect = true;
    base.unknown = v.unknown;
    ++counts_.bridged;
  }
}

Interpolator::Neighbours ImuHistory::neighbours(std::uint64_t i) const {
  return {values_of(at(i - 2)), values_of(at(i - 1)), values_of(at(i + 1)), values_of(at(i + 2))};
}

bool ImuHistory::has_neighbours(std::uint64_t i) const {
  const Span longest = Span::from_seconds(kLongestStep * period());
  for (std::uint64_t k = i - kReach; k <= i + kReach; ++k) {
    if (at(k).in_gap || (k != i && (at(k).distrusted || is_open(k)))) return false;
    if (k > i - kReach && at(k).stamp - at(k - 1).stamp > longest) return false;
  }
  return true;
}

Interpolator::Values ImuHistory::likely(std::uint64_t i) const { return interpolator_.between(neighbours(i)); }

/// Of reading i from what is likely; 1: so far only if it is corrupt.
double ImuHistory::departure(std::uint64_t i) const {
  Interpolator::Values limit = kCorrupt * interpolator_.usual_error();
  limit.head<3>() = limit.head<3>().max(SpikeJudge::kLeastRate);
  limit.tail<3>() = limit.tail<3>().max(SpikeJudge::kLeastForce);
  return ((values_of(at(i)) - likely(i)).abs() / limit).maxCoeff();
}

/// A reading that two others have followed. If it is corrupt a likelier value takes its place than the line that stood
/// there. If not, it teaches what is usual.
void ImuHistory::look_back() {
  std::rotate(departures_.begin(), departures_.begin() + 1, departures_.end());
  departures_.back() = -1;
  if (count_ - first() < 2 * kReach + 1) return;
  const std::uint64_t between = count_ - 1 - kReach;
  if (!has_neighbours(between)) return;
  if (at(between).suspect) {
    replace(at(between), likely(between));
    revise(between);
    return;
  }
  if (at(between).distrusted) return;
  departures_.back() = departure(between);
  interpolator_.learn(neighbours(between), values_of(at(between)));
  judge_again(between - kReach);
}

/// A spike below the limits of what may begin with one reading still departs from the four around it, more than any of
/// them does, and without it they are as usual.
void ImuHistory::judge_again(std::uint64_t i) {
  const auto [least, most] = std::minmax_element(departures_.begin(), departures_.end());
  if (*least < 0 || departures_[kReach] <= 1 || departures_[kReach] < *most) return;
  const Reading before = at(i);
  replace(at(i), likely(i));
  for (std::uint64_t k = i - kReach; k <= i + kReach; ++k) {
    if (k == i || departure(k) <= kUsual) continue;
    at(i) = before;
    return;
  }
  const Interpolator::Values off = (values_of(before) - values_of(at(i))).abs();
  at(i).suspect = true;
  at(i).unknown = {static_cast<float>(off.head<3>().maxCoeff()), static_cast<float>(off.tail<3>().maxCoeff())};
  departures_.fill(0);  // what the others departed was its doing
  ++counts_.bridged;
  revise(i);
}

/// A corrupt reading among four that are as usual was no motion: what is unknown is how well it is interpolated. In an
/// impact the others depart, too, and a peak that was taken for corrupt may have been real.
void ImuHistory::confirm(std::uint64_t i) {
  Reading& r = at(i);
  if (!r.suspect || !r.replaced) return;
  for (std::uint64_t k = i - kReach; k <= i + kReach; ++k)
    if (k != i && (!has_neighbours(k) || departure(k) > 1)) return;
  const Interpolator::Values usual = kUnknown * interpolator_.usual_error();
  r.unknown = {std::min(r.unknown.rate_rad_s, static_cast<float>(usual.head<3>().maxCoeff())),
               std::min(r.unknown.force_m_s2, static_cast<float>(usual.tail<3>().maxCoeff()))};
  r.distrusted = false;  // the watch said so of a value that is not used
  revise(i);
}

/// Only the axes that are corrupt: what the others measured is worth more than what is likely.
void ImuHistory::replace(Reading& r, const Interpolator::Values& likely) {
  const Interpolator::Values measured = values_of(r);
  const double limit = r.lost ? 0 : kCorruptAxis;
  const Interpolator::Values v =
      ((measured - likely).abs() > limit * interpolator_.usual_error()).select(likely, measured);
  r.w = v.head<3>();
  r.a = v.tail<3>();
  r.replaced = true;
}

ImuHistory::Reading ImuHistory::value(std::uint64_t i) const {
  Reading r = at(i);
  if (!is_open(i)) return r;
  std::uint64_t before = i, after = i;
  while (before > first() && is_open(before)) --before;
  while (after + 1 < count_ && is_open(after)) ++after;
  if (is_open(before)) before = after;
  if (is_open(after)) after = before;
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
  return std::max(longest, (t1 - trusted).seconds());
}

bool ImuHistory::reaches(HostStamp t) const {
  return count_ > 0 && t - newest_stamp() <= Span::from_seconds(period_.hole_s());
}

bool ImuHistory::integrate(HostStamp t0, HostStamp t1, const Density& density, Preintegration& out) const {
  constexpr Span kHeld{500'000'000};
  if (count_ == 0 || newest_stamp() + kHeld < t1 || t0 + kHeld < oldest_stamp()) return false;
  const double gap = period_.hole_s();
  Integration integration(out);
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
    integration.step(a.w, a.a, b.w, b.a, dt, noise);
  });
  return true;
}

void ImuHistory::propagate(HostStamp t0, HostStamp t1, const ImuScale& scale, NavState& x, Vec3& omega) const {
  if (count_ == 0) return;
  const double by_a = 1 + scale.accelerometer, by_g = 1 + scale.gyroscope;
  omega = by_g * (interpolated(before(t1), t1).w - x.b_g) + x.b_g;
  pieces(t0, t1, [&](const Reading& a, const Reading& b, double dt) {
    const Mat3 R1 = x.R * so3_exp(by_g * dt * (0.5 * (a.w + b.w) - x.b_g));
    const Vec3 acceleration = 0.5 * by_a * (x.R * (a.a - x.b_a) + R1 * (b.a - x.b_a)) + kGravity_W;
    x.p += x.v * dt + 0.5 * acceleration * dt * dt;
    x.v += acceleration * dt;
    x.R = R1;
  });
}

double ImuHistory::mean_rate(HostStamp t0, HostStamp t1, const Vec3& b_g) const {
  Vec3 sum = Vec3::Zero();
  int n = 0;
  each(t0, t1, [&](const Reading& r) {
    sum += r.w - b_g;
    ++n;
  });
  return n > 0 ? sum.norm() / n : 0;
}

}  // namespace epiline
