#include "estimator/monitor/rest_detector.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace epiline {

namespace {
constexpr double kYoungest_s = 0.35, kOldest_s = 0.7;  // age of the copy compared with
constexpr int kFewestCommon = 20;
constexpr int kMostStay = 3;  // times as many as have moved by themselves: own parts in view do not outvote the world
constexpr double kOutlier = 50;          // sigma^2; such pairs moved by themselves
constexpr double kSpreadLimit = 7.8;     // sigma^2; 5.8 is expected of two views, and of the sigma that residuals show
constexpr double kMovedLimit = 3.5;      // of the displacement's own sigma, over half a second
constexpr double kDriftedLimit = 5;      // the same since rest began, which is asked at every frame
constexpr double kPlainly = 3;           // times kMovedLimit: no slow drift
constexpr double kLeastSigma_px = 0.02;  // of a bearing
constexpr double kNoiseRoom = 1.65;      // times the least noise of this rest: that much may it change
constexpr double kCommon_px = 0.05;      // common error of all bearings of an image at standstill
constexpr double kShaken_px = 0.2;       // the same of one that shakes: its turns are not known better
constexpr double kLongest_s = 20;
constexpr double kReturns_s = 1;      // shaking takes it away from the reference for less; a drift does not come back
constexpr double kRateLimit = 0.02;   // rad/s
constexpr double kUnseen_rad = 0.02;  // no such turn since the last frame if the view is still and does not shake
}  // namespace

/// Of the bearings in common with an older frame.
struct RestDetector::Displacement {
  int common = 0, far = 0;  ///< bearings; those that moved too far to be counted
  double mean_square = 0;   ///< px^2
  double ratio = 0;         ///< how far the camera moved, over the sigma of that; any scale of the scene
  double shaken_ratio = 0;  ///< the same with more of a common error
  /// As of a vehicle that shakes.
  Displacement shaken() const {
    Displacement other = *this;
    other.ratio = shaken_ratio;
    return other;
  }
  bool is_known() const { return common >= kFewestCommon; }
  bool is_plain() const { return ratio > kPlainly * kMovedLimit || far > std::max(common, kFewestCommon); }
};

void RestDetector::clear() {
  stored_ = next_ = 0;
  has_reference_ = images_still_ = images_calm_ = was_drift_ = attitude_held_ = holds_ = false;
  needed_s_ = 0;
  noise_px_ = std::numeric_limits<double>::max();
}

RestDetector::Displacement RestDetector::displacement(const Snapshot& old, const TrackedFrame& frame, double sigma,
                                                      const Mat3& R_now_old) {
  Mat3 A = Mat3::Zero();
  Vec3 b = Vec3::Zero();
  double square = 0;
  Displacement moved;
  for (const TrackedFeature& f : frame.features) {
    const Entry* end = old.entry.data() + old.count;
    const Entry* e =
        std::lower_bound(old.entry.data(), end, f.id, [](const Entry& x, std::uint32_t id) { return x.id < id; });
    if (e == end || e->id != f.id) continue;
    const Eigen::Map<const Eigen::Matrix<double, 2, 3, Eigen::RowMajor>> chart(f.pixel_jacobian.data());
    const Vec2 d = chart * (Vec3(f.bearing.data()) - R_now_old * e->f_C);
    if (!(d.squaredNorm() <= kOutlier * sigma * sigma)) {  // so that NaN is far
      ++moved.far;
      continue;
    }
    A += chart.transpose() * chart;
    b += chart.transpose() * d;
    square += d.squaredNorm();
    ++moved.common;
  }
  if (!moved.is_known()) return moved;
  A.diagonal().array() += 1e-9 * A.trace();  // a narrow view does not see motion along its axis
  const double n = moved.common, explained = b.dot(A.ldlt().solve(b));
  const double variance = std::max((square - explained) / (2 * n - 3), 2 * kLeastSigma_px * kLeastSigma_px);
  moved.mean_square = square / n;
  moved.ratio = std::sqrt(explained / (variance + n * kCommon_px * kCommon_px));
  moved.shaken_ratio = std::sqrt(explained / (variance + n * kShaken_px * kShaken_px));
  return moved;
}

/// As it is, or turned by what the attitudes say, whichever moves less.
RestDetector::Displacement RestDetector::displacement(const Snapshot& old, const TrackedFrame& frame, double sigma,
                                                      const Attitude& attitude, bool& turned) {
  const Displacement plain = displacement(old, frame, sigma, Mat3::Identity());
  turned = attitude.shakes && (!plain.is_known() || plain.ratio > kMovedLimit);
  if (!turned) return plain;
  const Displacement other = displacement(old, frame, sigma, attitude.R_WC.transpose() * old.R_WC);
  return other.is_known() && other.shaken_ratio < plain.ratio ? other.shaken() : plain;
}

void RestDetector::remember(const TrackedFrame& frame, const Mat3& R_WC) {
  Snapshot& s = snapshot_[static_cast<std::size_t>(next_)];
  next_ = (next_ + 1) % kSnapshots;
  stored_ = std::min(stored_ + 1, kSnapshots);
  s.stamp = frame.stamp;
  s.R_WC = R_WC;
  s.count = 0;
  for (const TrackedFeature& f : frame.features)
    s.entry[static_cast<std::size_t>(s.count++)] = {f.id, Vec3(f.bearing.data())};
  std::sort(s.entry.data(), s.entry.data() + s.count, [](const Entry& a, const Entry& b) { return a.id < b.id; });
}

const RestDetector::Snapshot* RestDetector::half_a_second_old(HostStamp now) const {
  const Snapshot* old = nullptr;
  for (int i = 0; i < stored_; ++i) {
    const Snapshot& s = snapshot_[static_cast<std::size_t>(i)];
    const double age = (now - s.stamp).seconds();
    if (age >= kYoungest_s && age <= kOldest_s && (!old || s.stamp < old->stamp)) old = &s;
  }
  return old;
}

/// Forgets a reference that says nothing more, or shows a drift. A vehicle that is shaken comes back to it.
void RestDetector::compare_with_reference(const TrackedFrame& frame, double sigma, const Attitude& attitude) {
  bool turned = false;
  was_shaken_ = was_shaken_ || attitude.shakes;
  const Displacement drifted = displacement(reference_, frame, sigma, {attitude.R_WC, was_shaken_}, turned);
  attitude_held_ = attitude_held_ && !turned;
  is_there_ = drifted.is_known() && drifted.ratio < kDriftedLimit;
  holds_ = holds_ && (is_there_ || !drifted.is_known());
  if (is_there_) there_at_ = frame.stamp;
  has_reference_ = is_there_ || (drifted.is_known() && (frame.stamp - there_at_).seconds() < kReturns_s);
  if (has_reference_ || !drifted.is_known()) return;
  was_drift_ = was_reported_;
  needed_s_ = std::min(2 * std::max((frame.stamp - reference_.stamp).seconds(), needed_s_), kLongest_s);
}

void RestDetector::refer_to(const Snapshot& snapshot, HostStamp now) {
  reference_ = snapshot;
  has_reference_ = is_there_ = true;
  was_reported_ = was_shaken_ = false;
  there_at_ = now;
}

void RestDetector::assume_rest(const Mat3& R_WC) {
  for (Snapshot& s : snapshot_) s.R_WC = R_WC;
  needed_s_ = 0;
  refer_to(newest(), newest().stamp);
}

RestDetector::Verdict RestDetector::update(const TrackedFrame& frame, double sigma, double mean_rate,
                                           const Attitude& attitude) {
  const Snapshot* const old = half_a_second_old(frame.stamp);
  const double noise = has_reference_ && !attitude.shakes ? std::min(sigma, noise_px_) : sigma;
  bool turned = false;
  const Displacement moved = old ? displacement(*old, frame, sigma, attitude, turned) : Displacement{};
  const bool alike = moved.is_known() && moved.mean_square < kSpreadLimit * noise * noise;
  const bool most_stay = alike && kMostStay * moved.far <= moved.common;
  images_still_ = most_stay && moved.ratio < kMovedLimit;
  // What stood stands while anything does: a lorry that passes fills most of the view.
  const bool stays = images_still_ || (alike && moved.ratio < kMovedLimit && has_reference_ && holds_);
  if (images_still_) {
    const double seen_px = kNoiseRoom * std::max(kCommon_px, 0.5 * std::sqrt(moved.mean_square));
    noise_px_ = has_reference_ ? std::min(noise_px_, seen_px) : seen_px;
  }
  images_calm_ = most_stay && (attitude.shakes ? moved.shaken_ratio : moved.ratio) < kMovedLimit;
  attitude_held_ = !turned;
  was_drift_ = false;
  if (moved.is_plain() && !stays) {
    has_reference_ = holds_ = false;
    needed_s_ = 0;
  }
  const double turned_rad = mean_rate * (frame.stamp - newest().stamp).seconds();
  const bool turns = mean_rate >= kRateLimit && (!images_still_ || attitude.shakes || turned_rad <= kUnseen_rad);
  if (has_reference_) compare_with_reference(frame, sigma, attitude);
  if (!has_reference_ && stays && !was_drift_) refer_to(*old, frame.stamp);
  remember(frame, attitude.R_WC);
  if (!has_reference_ || (frame.stamp - reference_.stamp).seconds() < needed_s_) return Verdict::kMoves;
  if (stays && is_there_ && !turns) {
    was_reported_ = holds_ = true;
    return Verdict::kStands;
  }
  return attitude.shakes ? Verdict::kIsShaken : Verdict::kMoves;
}

}  // namespace epiline
