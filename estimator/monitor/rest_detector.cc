#include "estimator/monitor/rest_detector.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace epiline {

namespace {
constexpr double kYoungest_s = 0.35, kOldest_s = 0.7;  // age of the copy compared with
constexpr int kFewestCommon = 20;
constexpr double kOutlier = 50;          // sigma^2; such pairs moved by themselves
constexpr double kSpreadLimit = 5.4;     // sigma^2; 4 is expected of the difference of two views
constexpr double kMovedLimit = 3.5;      // of the displacement's own sigma, over half a second
constexpr double kDriftedLimit = 5;      // the same since rest began, which is asked at every frame
constexpr double kPlainly = 3;           // times kMovedLimit: no slow drift
constexpr double kLeastSigma_px = 0.02;  // of a bearing
constexpr double kCommon_px = 0.05;      // common error of all bearings of an image at standstill
constexpr double kLongest_s = 20;
constexpr double kRateLimit = 0.02;  // rad/s
}  // namespace

/// Of the bearings in common with an older frame.
struct RestDetector::Displacement {
  int common = 0, far = 0;  ///< bearings; those that moved too far to be counted
  double mean_square = 0;   ///< px^2
  double ratio = 0;         ///< how far the camera moved, over the sigma of that; any scale of the scene
  bool is_known() const { return common >= kFewestCommon; }
  bool is_plain() const { return ratio > kPlainly * kMovedLimit || far > std::max(common, kFewestCommon); }
};

void RestDetector::clear() {
  stored_ = next_ = 0;
  has_reference_ = is_rest_ = images_still_ = was_drift_ = false;
  needed_s_ = 0;
}

RestDetector::Displacement RestDetector::displacement(const Snapshot& old, const TrackedFrame& frame, double sigma) {
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
    const Vec2 d = chart * (Vec3(f.bearing.data()) - e->f_C);
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
  return moved;
}

void RestDetector::remember(const TrackedFrame& frame) {
  Snapshot& s = snapshot_[static_cast<std::size_t>(next_)];
  next_ = (next_ + 1) % kSnapshots;
  stored_ = std::min(stored_ + 1, kSnapshots);
  s.stamp = frame.stamp;
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

/// Forgets a reference that says nothing more, or shows a drift.
void RestDetector::compare_with_reference(const TrackedFrame& frame, double sigma) {
  const Displacement drifted = displacement(reference_, frame, sigma);
  has_reference_ = drifted.is_known() && drifted.ratio < kDriftedLimit;
  if (has_reference_ || !drifted.is_known()) return;
  was_drift_ = is_rest_;
  needed_s_ = std::min(2 * std::max((frame.stamp - reference_.stamp).seconds(), needed_s_), kLongest_s);
}

bool RestDetector::update(const TrackedFrame& frame, double sigma, double mean_rate) {
  const Snapshot* const old = half_a_second_old(frame.stamp);
  const Displacement moved = old ? displacement(*old, frame, sigma) : Displacement{};
  images_still_ = moved.is_known() && moved.ratio < kMovedLimit && moved.mean_square < kSpreadLimit * sigma * sigma;
  was_drift_ = false;
  if (moved.is_plain()) {
    has_reference_ = false;
    needed_s_ = 0;
  }
  if (has_reference_) compare_with_reference(frame, sigma);
  if (!has_reference_ && images_still_ && !was_drift_) {
    reference_ = *old;
    has_reference_ = true;
  }
  remember(frame);
  is_rest_ = images_still_ && has_reference_ && (frame.stamp - reference_.stamp).seconds() >= needed_s_ &&
             mean_rate < kRateLimit;
  return is_rest_;
}

}  // namespace epiline
