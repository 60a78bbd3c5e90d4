#include "estimator/factors/epipolar.h"

#include <cmath>

#include "estimator/factors/calibration.h"

namespace epiline {

namespace {
constexpr double kPaperSigmaPx = 1.5;  // VINS-Mono's, kept by the paper

EpipolarView make_view(const ExposedFrame& f, const Observation& o) {
  return {f.R_WC * (o.f_C / o.f_C.z()), f.c, f.c - f.p};
}

void huber(double s, double& rho, double& weight) {
  rho = s <= 1 ? s : 2 * std::sqrt(s) - 1;
  weight = s <= 1 ? 1 : 1 / std::sqrt(s);
}

void add_outer(double* H, const Vec6& a, const Vec6& b, double w) {
  Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(H).noalias() += w * a * b.transpose();
}

void add_pair(int i, int j, double r, const EpipolarJacobians& J, VisualSystem& out) {
  double rho = 0, w = 0;
  huber(r * r, rho, w);
  out.cost += rho;
  ++out.residuals;
  Eigen::Map<Vec6>(out.b[i]) -= w * r * J.i;
  Eigen::Map<Vec6>(out.b[j]) -= w * r * J.j;
  add_outer(out.H[i][i], J.i, J.i, w);
  add_outer(out.H[j][j], J.j, J.j, w);
  add_outer(out.H[i][j], J.i, J.j, w);
}

/// All pairs among the first `frames`; with `oldest_only` those that contain frame 0.
void add_pairs(const Window& w, const VisualSettings& s, int frames, bool oldest_only, VisualSystem& out) {
  clear(out, frames);
  EpipolarView view[kMaxFrames];
  ExposedFrame exposed[kMaxFrames];
  for (int k = 0; k < frames; ++k) exposed[k] = exposed_frame(w, k);
  int frame[kMaxFrames];
  for (int i = 0; i < w.track_count(); ++i) {
    const TrackRecord& t = w.track(i);
    if (!t.in_use || (oldest_only && !w.seen(t, 0))) continue;
    int n = 0;
    for (int k = 0; k < frames; ++k)
      if (w.seen(t, k) && w.view(t, k).f_C.z() > 0.05) {  // z has no meaning sideways and behind
        view[n] = make_view(exposed[k], w.view(t, k));
        frame[n++] = k;
      }
    if (n < 2) continue;
    ++out.tracks;
    for (int a = 0; a < (oldest_only ? 1 : n - 1); ++a)
      for (int b = a + 1; b < n; ++b) {
        EpipolarJacobians J;
        const double r = epipolar_residual(view[a], view[b], s.focal_px, &J);
        add_pair(frame[a], frame[b], r, J, out);
      }
  }
  add_calibration(w, frames, s.extrinsics, out);
}
}  // namespace

double epipolar_residual(const EpipolarView& i, const EpipolarView& j, double focal_px, EpipolarJacobians* J) {
  const double scale = focal_px / kPaperSigmaPx;
  const Vec3 t = i.c - j.c;
  const double length = std::max(t.norm(), 1e-9);
  const Vec3 n = t / length, x = i.z_W.cross(j.z_W);
  const double r = scale * n.dot(x);
  if (J) {
    const Vec3 q = scale * (x - n * n.dot(x)) / length;                     // dr/dt
    const Vec3 g_i = scale * j.z_W.cross(n), g_j = scale * n.cross(i.z_W);  // dr/dz_i, dr/dz_j
    J->i << q, i.z_W.cross(g_i) + i.lever.cross(q);
    J->j << -q, j.z_W.cross(g_j) - j.lever.cross(q);
  }
  return r;
}

double EpipolarFactor::cost(const Window& w) noexcept {
  linearise(w, trial_);
  return trial_.cost;
}

void EpipolarFactor::linearise(const Window& w, VisualSystem& out) noexcept {
  add_pairs(w, settings_, w.size(), false, out);
}

void EpipolarFactor::marginalise_oldest(const Window& w, const VisualSettings& s, VisualSystem& out) noexcept {
  add_pairs(w, s, w.size() - 1, true, out);
}

}  // namespace epiline
