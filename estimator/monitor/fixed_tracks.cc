#include "estimator/monitor/fixed_tracks.h"

#include <algorithm>

namespace epiline {

namespace {
constexpr double kStaysSigma = 4;    // of a bearing, between two views
constexpr double kRecently_s = 0.5;  // as long as the rest detector looks back
constexpr int kFewestMove = 20;
constexpr double kStayPerMoved = 1.5;  // at most: far points stay in a hover, and cars drive past who stands
}  // namespace

bool FixedTracks::Track::is_fixed() const { return against_s > kRecently_s; }

const FixedTracks::Track* FixedTracks::find(const List& list, std::uint32_t id) noexcept {
  const Track* end = list.track.data() + list.count;
  const Track* t =
      std::lower_bound(list.track.data(), end, id, [](const Track& x, std::uint32_t i) { return x.id < i; });
  return t != end && t->id == id ? t : nullptr;
}

bool FixedTracks::update(const TrackedFrame& frame, double pixel_sigma, bool moves) noexcept {
  const List& before = tracks_[newest_];
  List& now = tracks_[newest_ = 1 - newest_];
  now.count = 0;
  int moved = 0, stay = 0;
  for (const TrackedFeature& f : frame.features) {
    const Vec3 f_C(f.bearing.data());
    const Track* old = find(before, f.id);
    Track& t = now.track[static_cast<std::size_t>(now.count++)];
    t = old != nullptr ? *old : Track{.id = f.id, .since = frame.stamp, .f_C = f_C};
    const Eigen::Map<const Eigen::Matrix<double, 2, 3, Eigen::RowMajor>> chart(f.pixel_jacobian.data());
    if (!((chart * (f_C - t.f_C)).norm() <= kStaysSigma * pixel_sigma))  // so that NaN moves
      t = {.id = f.id, .has_moved = true, .since = frame.stamp, .f_C = f_C};
    const bool recently = (frame.stamp - t.since).seconds() < kRecently_s;
    moved += recently && t.has_moved;
    stay += !recently;
  }
  std::sort(now.track.data(), now.track.data() + now.count, [](const Track& a, const Track& b) { return a.id < b.id; });
  const double dt_s = std::min((frame.stamp - last_).seconds(), kRecently_s);
  last_ = frame.stamp;
  const bool against = moves && moved >= kFewestMove && kStayPerMoved * moved >= stay;
  bool found = false;
  fixed_ = 0;
  for (int i = 0; i < now.count; ++i) {
    Track& t = now.track[static_cast<std::size_t>(i)];
    const bool was = t.is_fixed();
    if (against) t.against_s += dt_s;
    fixed_ += t.is_fixed() ? 1 : 0;
    found = found || (t.is_fixed() && !was);
  }
  return found;
}

}  // namespace epiline
