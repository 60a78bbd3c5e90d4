#include "estimator/inertial/spike_judge.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace epiline {

namespace {
constexpr double kHolePeriods = 2.5, kNeverAHole_s = 0.004;  // jitter of fast sensors
constexpr double kMostRate = 100, kMostForce = 1000;  // rad/s, m/s^2: beyond the range of any inertial sensor in use
constexpr double kUnusual = 8;                        // times the mean departure
constexpr double kWildRate = 5, kWildForce = 100;     // departures for which one neighbour is no confirmation
constexpr double kLearnt = 1.0 / 64, kLearntFast = 1.0 / 8, kMostLearnt = 4;
constexpr double kManySuspects = 0.25, kShareMemory = 1.0 / 8;  // of the last readings
constexpr double kMostUnknown = 4;                              // times the limit
constexpr Span kLongestBurst = Span::from_milliseconds(20);
constexpr int kShortestBurst = 3;  // readings, at low rates
constexpr double kForgotten_s = 1;
}  // namespace

bool is_impossible(const Vec3& w, const Vec3& a) noexcept {
  if (!w.allFinite() || !a.allFinite()) return true;
  if (w.cwiseAbs().maxCoeff() > kMostRate || a.cwiseAbs().maxCoeff() > kMostForce) return true;
  return w.isZero(0) && a.isZero(0);
}

double ReadingPeriod::hole_s() const noexcept { return std::max(kNeverAHole_s, kHolePeriods * period_s_); }

bool ReadingPeriod::step(HostStamp stamp) noexcept {
  const double dt = (stamp - last_).seconds(), hole = hole_s();
  last_ = stamp;
  if (!std::exchange(any_, true)) return false;
  const bool after_hole = period_s_ > 0 && dt > hole;
  // A hole counts as the shortest one: a period learnt from a burst must be able to grow.
  period_s_ = period_s_ > 0 ? 0.95 * period_s_ + 0.05 * std::min(dt, hole) : dt;
  return after_hole;
}

Vec3 SpikeJudge::rate_limit() const noexcept {
  return (kUnusual * rate_scale_).cwiseMax(kLeastRate).cwiseMin(kWildRate);
}
Vec3 SpikeJudge::force_limit() const noexcept {
  return (kUnusual * force_scale_).cwiseMax(kLeastForce).cwiseMin(kWildForce);
}

/// In units of the limits: the largest of the six values.
double SpikeJudge::distance(const Point& x, const Point& y) const noexcept {
  return std::max((x.w - y.w).cwiseAbs().cwiseQuotient(rate_limit()).maxCoeff(),
                  (x.a - y.a).cwiseAbs().cwiseQuotient(force_limit()).maxCoeff());
}

SpikeJudge::Point SpikeJudge::on_line(const Point& from, const Point& to, HostStamp t) const noexcept {
  const double u = (t - from.stamp).seconds() / (to.stamp - from.stamp).seconds();
  return {t, from.w + u * (to.w - from.w), from.a + u * (to.a - from.a)};
}

/// From the last reading believed, or from the line through the last two if that is nearer.
double SpikeJudge::departure(const Point& r) const noexcept {
  const double held = distance(r, base_);
  return has_before_ ? std::min(held, distance(r, on_line(before_base_, base_, r.stamp))) : held;
}

bool SpikeJudge::agrees(const Point& r) const noexcept {
  if (!base_alone_ && (worst_rate_ > kWildRate || worst_force_ > kWildForce)) return false;
  const double apart = distance(r, suspect_), away = std::max(distance(r, base_), distance(suspect_, base_));
  return apart <= std::max(1.0, 0.5 * away);
}

SpikeJudge::Past SpikeJudge::past(const Point& r) const noexcept {
  const bool back = distance(r, base_) <= 1 + suspects_;
  const bool agreed = agrees(r);
  if (back && agreed) {
    const bool near_suspect = distance(r, suspect_) < distance(r, base_);
    const bool on_the_way = distance(suspect_, on_line(base_, r, suspect_.stamp)) <= 1;
    return near_suspect || on_the_way ? Past::kReal : Past::kSpikes;
  }
  if (back) return Past::kSpikes;
  if (agreed) return Past::kReal;
  return suspects_ >= kShortestBurst && r.stamp - base_.stamp > kLongestBurst ? Past::kGap : Past::kOpen;
}

/// The mean departure of each axis, in which a single one counts for no more than a few usual ones.
void SpikeJudge::learn(const Point& r, double share) noexcept {
  const Point line = has_before_ ? on_line(before_base_, base_, r.stamp) : base_;
  const auto toward = [share](Vec3& scale, const Vec3& held, const Vec3& extrapolated, double most, double least) {
    const Vec3 seen = held.cwiseAbs().cwiseMin(extrapolated.cwiseAbs()).cwiseMin(most);
    const Vec3 clipped = seen.cwiseMin(kMostLearnt * scale + Vec3::Constant(least));
    scale += share * (clipped - scale);
  };
  toward(rate_scale_, r.w - base_.w, r.w - line.w, kWildRate, 1e-3);
  toward(force_scale_, r.a - base_.a, r.a - line.a, kWildForce, 1e-2);
}

void SpikeJudge::believe(const Point& r) noexcept {
  before_base_ = base_;
  has_before_ = any_;
  base_ = r;
  any_ = true;
  suspects_ = 0;
  worst_rate_ = worst_force_ = 0;
}

SpikeJudge::Unknown SpikeJudge::unknown() const noexcept {
  const double in_a_row = std::sqrt(std::max(1, suspects_));  // neighbours are off together
  const auto size = [&](double worst, double usual, double limit) {
    return static_cast<float>(in_a_row * std::clamp(worst, usual, kMostUnknown * limit));
  };
  return {size(worst_rate_, rate_scale_.maxCoeff(), rate_limit().maxCoeff()),
          size(worst_force_, force_scale_.maxCoeff(), force_limit().maxCoeff())};
}

SpikeJudge::Unknown SpikeJudge::unknown_of_lost(int in_a_row) const noexcept {
  const double root = std::sqrt(in_a_row);  // neighbours are off together
  return {static_cast<float>(root * rate_scale_.maxCoeff()), static_cast<float>(root * force_scale_.maxCoeff())};
}

void SpikeJudge::forget(HostStamp now) noexcept {
  recent_ *= std::exp(-std::max(0.0, (now - recent_at_).seconds()) / kForgotten_s);
  recent_at_ = now;
}

void SpikeJudge::suspect(const Point& r) noexcept {
  suspect_ = r;
  ++suspects_;
  suspect_share_ += kShareMemory * (1 - suspect_share_);
  worst_rate_ = std::max(worst_rate_, (r.w - base_.w).norm());
  worst_force_ = std::max(worst_force_, (r.a - base_.a).norm());
}

/// Nothing before it is a guide: the next one must agree with it.
SpikeJudge::Verdict SpikeJudge::begin_anew(const Point& r, Verdict v) noexcept {
  any_ = false;
  believe(r);
  suspect(r);
  base_alone_ = false;
  v.suspect = true;
  return v;
}

SpikeJudge::Verdict SpikeJudge::step(HostStamp stamp, const Vec3& w, const Vec3& a, bool after_gap) noexcept {
  const Point r{stamp, w, a};
  Verdict v;
  forget(stamp);
  if (!any_ || after_gap) {
    if (suspects_ > 0) v = {false, Past::kSpikes, suspects_, false, unknown()};
    any_ = false;
    believe(r);
    base_alone_ = true;
    return v;
  }
  if (suspects_ == 0 && departure(r) <= 1) {
    learn(r, kLearnt);
    suspect_share_ -= kShareMemory * suspect_share_;
    believe(r);
    base_alone_ = false;
    return v;
  }
  // so many suspects are no spikes: a vibration begins
  learn(r, suspect_share_ > kManySuspects ? kLearntFast : kLearnt);
  if (suspects_ > 0) {
    v.past = past(r);
    v.past_count = suspects_;
    v.unknown = unknown();
  }
  if (v.past != Past::kOpen) {
    v.base_is_spike = v.past == Past::kReal && base_alone_;
    const bool spikes = v.past == Past::kSpikes || v.base_is_spike;
    if (spikes) recent_ += 1;
    if (v.past == Past::kReal) believe(suspect_);
    if (v.past == Past::kGap) return begin_anew(r, v);
    believe(r);
    base_alone_ = false;
    return v;
  }
  suspect(r);
  v.suspect = true;
  const double in_a_row = std::sqrt(suspects_);
  v.unknown.rate_rad_s = static_cast<float>(in_a_row * std::clamp(worst_rate_, rate_scale_.maxCoeff(), kWildRate));
  v.unknown.force_m_s2 = static_cast<float>(in_a_row * std::clamp(worst_force_, force_scale_.maxCoeff(), kWildForce));
  return v;
}

}  // namespace epiline
