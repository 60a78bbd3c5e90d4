#include "estimator/window/keyframe.h"

namespace epiline {

namespace {
constexpr int kFewestCommon = 20;
constexpr double kLeastOverlap = 0.5;
constexpr double kStays_px = 1;
constexpr int kFewMove = 4;  // times fewer than all: they move by themselves

struct Comparison {
  int common = 0, later = 0;
  double parallax_px = 0;
};

/// Bearings of frame k turned by R_jk against those of frame j, in the first camera's axes; for small angles the chord
/// is the angle. Where the scene moves past, tracks that stay at their pixel do not count: they lie on the vehicle or
/// too far away to show its way, and outlive all that do show it.
Comparison compare(const Window& w, int j, int k, const Mat3& R_jk, double focal_px) {
  Comparison c;
  int moved = 0;
  double sum = 0, sum_moved = 0;
  for (int i = 0; i < w.track_count(); ++i) {
    const TrackRecord& t = w.track(i);
    if (!w.seen(t, k)) continue;
    ++c.later;
    if (!w.seen(t, j)) continue;
    ++c.common;
    const Vec3 before = bearing_of(w.view(t, j)), now = bearing_of(w.view(t, k));
    const Mat3& R_CD = w.rig.poses[t.camera].R_CD;
    const double parallax = t.camera > 0 ? (R_jk * (R_CD * now) - R_CD * before).norm() : (R_jk * now - before).norm();
    sum += parallax;
    if (focal_px * (now - before).norm() < kStays_px) continue;
    sum_moved += parallax;
    ++moved;
  }
  if (moved >= kFewestCommon && kFewMove * moved > c.common) {
    c.later -= c.common - moved;
    c.common = moved;
    sum = sum_moved;
  }
  if (c.common > 0) c.parallax_px = focal_px * sum / c.common;
  return c;
}

Mat3 relative_rotation(const Window& w, int j, int k) {
  const Mat3& R_BC = w.calibration.R_BC;
  return R_BC.transpose() * w.at(j).x.R.transpose() * w.at(k).x.R * R_BC;
}
}  // namespace

int common_tracks(const Window& w, int j, int k) {
  int common = 0;
  for (int i = 0; i < w.track_count(); ++i) common += w.seen(w.track(i), j) && w.seen(w.track(i), k);
  return common;
}

double compensated_parallax_px(const Window& w, int j, int k, double focal_px) {
  return compare(w, j, k, relative_rotation(w, j, k), focal_px).parallax_px;
}

double widest_parallax_px(const Window& w, double focal_px) {
  const int newest = w.size() - 1;
  for (int j = 0; j < newest; ++j)
    if (common_tracks(w, j, newest) >= kFewestCommon) return compensated_parallax_px(w, j, newest, focal_px);
  return 0;
}

bool is_keyframe(const Window& w, int j, int k, const KeyframeSettings& s) {
  if (j < 0) return true;
  const Comparison c = compare(w, j, k, relative_rotation(w, j, k), s.focal_px);
  if (c.later == 0) return false;  // a frame that sees nothing constrains nothing
  if (c.common < kFewestCommon || c.parallax_px > s.parallax_px) return true;
  return c.common < kLeastOverlap * c.later;
}

}  // namespace epiline
