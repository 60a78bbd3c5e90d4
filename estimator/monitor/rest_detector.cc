#include "estimator/monitor/rest_detector.h"

#include <algorithm>
#include <cmath>

namespace epiline {

namespace {
constexpr double kYoungest_s = 0.35, kOldest_s = 0.7;  // age of the copy compared with
constexpr int kFewestCommon = 20;
constexpr double kOutlier = 50;       // sigma^2; such pairs moved by themselves
constexpr double kMeanLimit = 3.5;    // of the mean's own sigma
constexpr double kSpreadLimit = 5.4;  // sigma^2; 4 is expected of the difference of two views
constexpr double kRateLimit = 0.02;   // rad/s
}  // namespace

void RestDetector::clear() {
  stored_ = next_ = 0;
  images_still_ = false;
}

bool RestDetector::still_against(const Snapshot& old, const TrackedFrame& frame, double sigma) const {
  Vec2 mean = Vec2::Zero();
  double square = 0;
  int n = 0;
  for (const TrackedFeature& f : frame.features) {
    const Entry* end = old.entry.data() + old.count;
    const Entry* e =
        std::lower_bound(old.entry.data(), end, f.id, [](const Entry& a, std::uint32_t id) { return a.id < id; });
    if (e == end || e->id != f.id) continue;
    const Eigen::Map<const Eigen::Matrix<double, 2, 3, Eigen::RowMajor>> chart(f.pixel_jacobian.data());
    const Vec2 d = chart * (Vec3(f.bearing.data()) - e->f_C);
    const double s = d.squaredNorm();
    if (s > kOutlier * sigma * sigma) continue;
    mean += d;
    square += s;
    ++n;
  }
  if (n < kFewestCommon) return false;
  return mean.norm() / n < kMeanLimit * sigma * std::sqrt(2.0 / n) && square / n < kSpreadLimit * sigma * sigma;
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

bool RestDetector::update(const TrackedFrame& frame, double sigma, double mean_rate) {
  const Snapshot* old = nullptr;
  for (int i = 0; i < stored_; ++i) {
    const Snapshot& s = snapshot_[static_cast<std::size_t>(i)];
    const double age = (frame.stamp - s.stamp).seconds();
    if (age >= kYoungest_s && age <= kOldest_s && (!old || s.stamp < old->stamp)) old = &s;
  }
  images_still_ = old && still_against(*old, frame, sigma);
  remember(frame);
  return images_still_ && mean_rate < kRateLimit;
}

}  // namespace epiline
