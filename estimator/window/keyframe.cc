#include "estimator/window/keyframe.h"

namespace epiline {

namespace {
constexpr int kFewestCommon = 20;
constexpr double kLeastOverlap = 0.5;

struct Comparison {
  int common = 0, later = 0;
  double parallax_px = 0;
};

/// Bearings of frame k turned by R_jk against those of frame j, in the first camera's axes; for small angles the chord
/// is the angle.
Comparison compare(const Window& w, int j, int k, const Mat3& R_jk, double focal_px) {
  Comparison c;
  double sum = 0;
  for (int i = 0; i < w.track_count(); ++i) {
    const TrackRecord& t = w.track(i);
    if (!w.seen(t, k)) continue;
    ++c.later;
    if (!w.seen(t, j)) continue;
    ++c.common;
    const Vec3 &before = w.view(t, j).f_C, &now = w.view(t, k).f_C;
    const Mat3& R_CD = w.rig.poses[t.camera].R_CD;
    sum += t.camera > 0 ? (R_jk * (R_CD * now) - R_CD * before).norm() : (R_jk * now - before).norm();
  }
  if (c.common > 0) c.parallax_px = focal_px * sum / c.common;
  return c;
}

Mat3 relative_rotation(const Window& w, int j, int k) {
  const Mat3& R_BC = w.calibration.R_BC;
  return R_BC.transpose() * w.at(j).x.R.transpose() * w.at(k).x.R * R_BC;
}
}  // namespace

double compensated_parallax_px(const Window& w, int j, int k, double focal_px, int* common) {
  const Comparison c = compare(w, j, k, relative_rotation(w, j, k), focal_px);
  if (common) *common = c.common;
  return c.parallax_px;
}

double widest_parallax_px(const Window& w, double focal_px) {
  for (int j = 0; j < w.size() - 1; ++j) {
    int common = 0;
    const double parallax_px = compensated_parallax_px(w, j, w.size() - 1, focal_px, &common);
    if (common >= kFewestCommon) return parallax_px;
  }
  return 0;
}

bool is_keyframe(const Window& w, const KeyframeSettings& s) {
  const int k = w.size() - 2, j = k - 1;
  if (j < 0) return true;
  const bool compensated = s.rule == KeyframeRule::kCompensatedParallax;
  const Comparison c = compare(w, j, k, compensated ? relative_rotation(w, j, k) : Mat3::Identity(), s.focal_px);
  if (c.later == 0) return false;  // a frame that sees nothing constrains nothing
  if (c.common < kFewestCommon || c.parallax_px > s.parallax_px) return true;
  return compensated && c.common < kLeastOverlap * c.later;
}

}  // namespace epiline
