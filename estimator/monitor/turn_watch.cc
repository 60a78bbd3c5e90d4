#include "estimator/monitor/turn_watch.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "estimator/geometry/so3.h"

namespace epiline {

namespace {
constexpr double kLongestPair_s = 0.5;
constexpr Span kBetweenIntegrals = Span::from_seconds(0.0039);
constexpr double kFewTurns = 30;
// Of a fit to the bearings. Of 1100 pairs of MH_01 and V1_02 about 99 in 100 are below 0.65 (median 0.03 and 0.14), and
// those of MH_01 with a wrong turn between 2.4 and 4.1.
constexpr double kWorstCost = 1;
constexpr double kMostAmbiguous = 0.05;  // rad/s: over a plane, a third of the slowest turns that are judged
constexpr double kStill = 0.05;          // rad/s: standing says nothing, and a verdict must outlast it
constexpr double kCostShare = 0.1;       // of a pair in their mean
constexpr double kUsualCost = 1.2;       // times that mean: another direction would hardly do better
constexpr int kTryAll = 8;               // of so many pairs, one is fitted from every direction

Vec3 rate_of(const ImuSample& reading) { return Vec3::Map(reading.angular_velocity_rad_s.data()); }

/// False for one that no lens gives, which would corrupt the fit; written so that a NaN fails.
bool is_bearing(const TrackedFeature& f) { return std::abs(Vec3::Map(f.bearing.data()).squaredNorm() - 1) < 1e-3; }

/// Axis by axis: a single corrupt reading disappears.
Vec3 median(const Vec3& a, const Vec3& b, const Vec3& c) { return a.cwiseMin(b).cwiseMax(a.cwiseMax(b).cwiseMin(c)); }

/// The largest tr(R^T M) over rotations R (sign +1) or reflections (-1): the singular values, the least with a sign.
double best_trace(const Mat3& M, double sign) {
  Eigen::SelfAdjointEigenSolver<Mat3> eigen;
  eigen.computeDirect(M.transpose() * M, Eigen::EigenvaluesOnly);
  const Vec3 s = eigen.eigenvalues().cwiseMax(0).cwiseSqrt();  // ascending
  return s[2] + s[1] + (M.determinant() * sign < 0 ? -s[0] : s[0]);
}
}  // namespace

TurnWatch::TurnWatch(double time_offset_s, double memory_s)
    : kernels_(turn_kernels(best_instruction_set())), offset_(Span::from_seconds(time_offset_s)), memory_s_(memory_s) {}

/// In the image before; null: it was not seen.
const Vec3* TurnWatch::bearing_before(std::uint32_t id) const noexcept {
  const Seen* const end = seen_.data() + seen_count_;
  const Seen* const s =
      std::lower_bound(seen_.data(), end, id, [](const Seen& x, std::uint32_t i) { return x.id < i; });
  return s != end && s->id == id ? &s->f_C : nullptr;
}

void TurnWatch::forget() noexcept {
  seen_count_ = 0;
  pending_first_ = pending_end_;
  turned_s_ = turns_ = cc_ = 0;
  c_.setZero();
  sums_ = {};
}

void TurnWatch::add_images(const TrackedFrame& frame) noexcept {
  const double dt_s = (frame.stamp - last_stamp_).seconds();
  if (seen_count_ > 0 && dt_s > 0 && dt_s < kLongestPair_s) {
    // of many shared ones, evenly picked ones are enough
    int common = 0;
    const auto each_shared = [&](const auto& use) {
      for (const TrackedFeature& f : frame.features) {
        const Vec3* const before = is_bearing(f) ? bearing_before(f.id) : nullptr;
        if (before != nullptr) use(*before, f);
      }
    };
    each_shared([&](const Vec3&, const TrackedFeature&) { ++common; });
    shared_ = {};
    int k = 0;
    each_shared([&](const Vec3& before, const TrackedFeature& f) {
      const int most = SharedBearings::kMost;
      const bool take = common <= most || k * most / common != (k - 1) * most / common || k == 0;
      ++k;
      if (!take || shared_.count == most) return;
      shared_.before.set(shared_.count, before);
      shared_.now.set(shared_.count, Vec3::Map(f.bearing.data()));
      ++shared_.count;
    });
    CameraTurn turn;
    // Of a wide lens a usual fit costs more. Now and then all are tried, lest a poor one becomes usual.
    const double usual_cost = ++fits_ % kTryAll == 0 ? 0 : std::min(kUsualCost * cost_, kWorstCost);
    const bool fitted = turn_between(shared_, so3_exp(-dt_s * rate_C_), direction_, usual_cost, kernels_, turn);
    if (fitted) cost_ += (cost_ == 0 ? 1 : kCostShare) * (turn.cost - cost_);
    const double ambiguous = kMostAmbiguous * dt_s;
    if (fitted && turn.cost < kWorstCost && settle_plane(shared_, ambiguous, kernels_, turn) < ambiguous) {
      direction_ = turn.direction;
      rate_C_ = so3_log(turn.R_CC0.transpose()) / dt_s;
      if (pending_end_ - pending_first_ == kPending) ++pending_first_;
      pending_[pending_end_++ % kPending] = {last_stamp_, frame.stamp, rate_C_};
    }
  }
  last_stamp_ = frame.stamp;
  seen_count_ = 0;
  for (const TrackedFeature& f : frame.features)
    if (is_bearing(f)) seen_[static_cast<std::size_t>(seen_count_++)] = {f.id, Vec3::Map(f.bearing.data())};
  std::sort(seen_.data(), seen_.data() + seen_count_, [](const Seen& a, const Seen& b) { return a.id < b.id; });
  use_turns();
}

void TurnWatch::add_reading(const ImuSample& reading) noexcept {
  newest_[static_cast<std::size_t>(readings_ % 3)] = reading;
  if (++readings_ < 3) return;
  const auto& r = newest_;
  ImuSample middle = r[static_cast<std::size_t>((readings_ - 2) % 3)];  // of the three
  Vec3::Map(middle.angular_velocity_rad_s.data()) = median(rate_of(r[0]), rate_of(r[1]), rate_of(r[2]));
  if (readings_ >= 6) readings_ -= 3;
  integrate(middle);
  use_turns();
}

void TurnWatch::integrate(const ImuSample& reading) noexcept {
  const Vec3 rate = rate_of(reading);
  const double dt_s = (reading.stamp - integrated_to_).seconds();
  if (integral_end_ > 0 && !(dt_s > 0)) return;
  if (integral_end_ > 0) angle_ += 0.5 * dt_s * (rate + rate_);
  rate_ = rate;
  integrated_to_ = reading.stamp;
  if (integral_end_ > 0 && reading.stamp - integral_[(integral_end_ - 1) % kIntegrals].stamp < kBetweenIntegrals)
    return;
  integral_[integral_end_++ % kIntegrals] = {reading.stamp, angle_};
}

/// The last integral not after `stamp`, but for the newest. Empty: the stamp lies before the first one kept.
std::optional<std::uint32_t> TurnWatch::integral_at(HostStamp stamp) const noexcept {
  const std::uint32_t first = integral_end_ > kIntegrals ? integral_end_ - kIntegrals : 0;
  if (integral_end_ - first < 2 || stamp < integral_[first % kIntegrals].stamp) return {};
  std::uint32_t low = first, high = integral_end_ - 1;
  while (high - low > 1) {
    const std::uint32_t middle = low + (high - low) / 2;
    (integral_[middle % kIntegrals].stamp <= stamp ? low : high) = middle;
  }
  return low;
}

/// Linear between the stored ones. `from`: an integral not after the stamp; it is moved on to the last one.
Vec3 TurnWatch::angle_at(HostStamp stamp, std::uint32_t& from) const noexcept {
  while (from + 2 < integral_end_ && integral_[(from + 1) % kIntegrals].stamp <= stamp) ++from;
  const Integral &a = integral_[from % kIntegrals], &b = integral_[(from + 1) % kIntegrals];
  return a.angle_B + (stamp - a.stamp).seconds() / (b.stamp - a.stamp).seconds() * (b.angle_B - a.angle_B);
}

/// Those for which all readings have come.
void TurnWatch::use_turns() noexcept {
  if (integral_end_ == 0) return;
  const HostStamp reached = integral_[(integral_end_ - 1) % kIntegrals].stamp;
  for (; pending_first_ != pending_end_; ++pending_first_) {
    const Turn& turn = pending_[pending_first_ % kPending];
    if (turn.to + offset_ + kReach > reached) return;
    use(turn);
  }
}

void TurnWatch::use(const Turn& turn) noexcept {
  if (turn.rate_C.norm() < kStill) return;
  const double dt_s = (turn.to - turn.from).seconds();
  const std::optional<std::uint32_t> first = integral_at(turn.from + offset_ - kReach);
  if (!first) return;
  const double fade = turns_ > 0 ? std::exp(-std::max(0.0, (turn.to - faded_to_).seconds()) / memory_s_) : 0;
  faded_to_ = turn.to;
  turned_s_ = fade * turned_s_ + dt_s;
  turns_ = fade * turns_ + 1;
  c_ = fade * c_ + turn.rate_C;
  cc_ = fade * cc_ + turn.rate_C.squaredNorm();
  std::uint32_t from = *first, to = from;
  for (int i = 0; i < kOffsets; ++i) {
    const Span by = offset_ + Span::from_seconds((i - kMiddle) * kStep_s);
    const Vec3 b = (angle_at(turn.to + by, to) - angle_at(turn.from + by, from)) / dt_s;
    Sums& s = sums_[static_cast<std::size_t>(i)];
    s.b = fade * s.b + b;
    s.bb = fade * s.bb + b.squaredNorm();
    s.bc = fade * s.bc + b * turn.rate_C.transpose();
  }
}

/// The means are left out: they hold the gyroscope's bias.
TurnWatch::Fit TurnWatch::fit_at(int offset) const noexcept {
  const Sums& s = sums_[static_cast<std::size_t>(offset)];
  Fit fit;
  fit.sum = s.bc - s.b * c_.transpose() / turns_;
  fit.bb = s.bb - s.b.squaredNorm() / turns_;
  fit.cc = cc_ - c_.squaredNorm() / turns_;
  fit.agreement = best_trace(fit.sum, 1) / std::sqrt(std::max(fit.bb * fit.cc, 1e-30));
  return fit;
}

double TurnWatch::noise_rad() const noexcept { return kCostScale_rad * std::sqrt(std::expm1(cost_)); }

TurnAgreement TurnWatch::agreement() const noexcept {
  TurnAgreement r;
  r.turned_s = turned_s_;
  r.turns = turns_;
  if (!(turns_ >= kFewTurns)) return r;
  int best = 0, best_mirrored = 0;
  std::array<double, kOffsets> agreement;
  for (int i = 0; i < kOffsets; ++i) {
    const Fit f = fit_at(i);
    agreement[static_cast<std::size_t>(i)] = f.agreement;
    if (f.agreement > agreement[static_cast<std::size_t>(best)]) best = i;
    const double mirrored = best_trace(f.sum, -1) / std::sqrt(std::max(f.bb * f.cc, 1e-30));
    if (mirrored <= r.agreement_mirrored) continue;
    r.agreement_mirrored = mirrored;
    best_mirrored = i;
  }
  if (r.agreement_mirrored > 0) r.mirrored_BC = -rotation_from(-fit_at(best_mirrored).sum);
  const Fit fit = fit_at(best);
  r.rate_rad_s = std::sqrt(std::max(0.0, fit.cc) / turns_);
  // the top of the parabola through it and its neighbours
  const auto at = [&](int i) { return agreement[static_cast<std::size_t>(std::clamp(i, 0, kOffsets - 1))]; };
  const double left = at(best - 1), right = at(best + 1), bend = left - 2 * at(best) + right;
  const double top = bend < 0 ? std::clamp(0.5 * (left - right) / bend, -1., 1.) : 0;
  r.time_offset_s = offset_.seconds() + (best - kMiddle + top) * kStep_s;
  r.offset_loss = at(best) - at(kMiddle);
  r.agreement = fit.agreement;
  r.R_BC = rotation_from(fit.sum);
  const Vec3 spread = fit.sum.jacobiSvd().singularValues();
  r.weakest_axis = spread[0] > 0 ? std::sqrt(spread[2] / spread[0]) : 0;
  r.rate_ratio = std::sqrt(fit.bb / std::max(fit.cc, 1e-30));
  // Turning the fit by a small a (on the right) loses a'(tr(D) - D)a/2 of the trace, D = R_BC' sum; what the fit leaves
  // is the noise of the turns.
  Mat3 D = r.R_BC.transpose() * fit.sum;
  D = 0.5 * (D + D.transpose()).eval();
  const double left_over = std::max(0.0, fit.bb + fit.cc - 2 * D.trace()) / (3 * turns_);
  const Mat3 information = D.trace() * Mat3::Identity() - D + 1e-12 * Mat3::Identity();
  r.R_BC_covariance = left_over * information.inverse();
  return r;
}

}  // namespace epiline
