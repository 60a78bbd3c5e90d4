#include "estimator/factors/beam.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "estimator/factors/height.h"

namespace epiline {

namespace {

constexpr double kCauchyBeam = 3;    // scale of the kernel, in sigmas
constexpr double kNearBeam = 0.985;  // cosine of 10 degrees: how far from the beam a track may be
// Of the distance: of tracks that know less of their depth the derivatives are noise, which would count as knowledge.
constexpr double kMostRelative = 0.05;
constexpr int kLeastViews = 3;

constexpr std::size_t kRange = static_cast<std::size_t>(HeightKind::kRangeFinder);

/// Where a track is seen from frame k, by all its views: at c_k + m / rho, so rho, 1/m, is one over how far it is
/// below.
struct Depth {
  Vec3 m = Vec3::Zero();  ///< W, with m_z = -1
  double rho = 0;
  Vec3 lambda = Vec3::Zero();  ///< covariance of rho with (m_x, m_y, rho), of rays with errors of 1
  bool found = false;
};

struct Ray {
  Vec3 c, f;  ///< where the camera was, and the unit bearing; W
};
Ray ray_of(const Window& w, const NavState& x, const Observation& o) {
  return {x.p + x.R * w.calibration.p_BC, x.R * (w.calibration.R_BC * bearing_of(o))};
}

Vec3 camera_of(const Window& w, int k) { return w.at(k).x.p + w.at(k).x.R * w.calibration.p_BC; }

template <class F>
void each_view(const Window& w, const TrackRecord& t, int frames, F&& f) {
  for (int j = 0; j < frames; ++j)
    if (w.seen(t, j)) f(j, ray_of(w, w.at(j).x, w.view(t, j)));
}

/// d Y / d (m_x, m_y, rho).
Mat3 by_depth(const Vec3& baseline) {
  Mat3 G = Mat3::Identity();
  G.col(2) = baseline;
  return G;
}

Depth depth_of(const Window& w, const TrackRecord& t, int k, int frames) {
  const Vec3 o = camera_of(w, k);
  Mat3 N = Mat3::Zero();
  Vec3 b = Vec3::Zero();
  int views = 0;
  each_view(w, t, frames, [&](int, const Ray& ray) {
    const Mat3 across = Mat3::Identity() - ray.f * ray.f.transpose(), G = by_depth(o - ray.c);
    N += G.transpose() * across * G;
    b += G.transpose() * across.col(2);
    ++views;
  });
  Depth d;
  if (views < kLeastViews) return d;
  Mat3 covariance = Mat3::Zero();
  bool invertible = false;
  double determinant = 0;
  N.computeInverseAndDetWithCheck(covariance, determinant, invertible, 0);
  const Vec3 x = covariance * b;
  d.m = Vec3(x.x(), x.y(), -1);
  d.rho = x.z();
  d.lambda = covariance.col(2);
  d.found = invertible && x.allFinite() && d.lambda.z() > 0;
  return d;
}

bool is_near(const Window& w, int k, const HeightReading& reading, const TrackRecord& t) {
  const Vec3 to_end = (reading.lever_B - w.calibration.p_BC).normalized();
  return (w.calibration.R_BC * bearing_of(w.view(t, k))).dot(to_end) > kNearBeam;
}

bool serves_another(const Window& w, std::uint32_t id) {
  for (int k = 0; k < w.size(); ++k) {
    const BeamTracks& tracks = w.at(k).beam;
    const auto end = tracks.ids.begin() + tracks.count;
    if (std::find(tracks.ids.begin(), end, id) != end) return true;
  }
  return false;
}

void look_for_tracks(const Window& w, int k, const HeightReading& reading, std::span<const std::uint32_t> used,
                     BeamTracks& out) {
  for (int i = 0; i < w.track_count() && out.count < static_cast<int>(out.ids.size()); ++i) {
    const TrackRecord& t = w.track(i);
    if (t.camera > 0 || !w.seen(t, k) || w.views(t) < kLeastViews || !is_near(w, k, reading, t)) continue;
    if (std::find(used.begin(), used.end(), t.id) != used.end() || serves_another(w, t.id)) continue;
    out.ids[static_cast<std::size_t>(out.count++)] = t.id;
  }
}

/// So many frames share one error of the ground.
double frames_per_stretch(const Window& w) {
  constexpr double kMost = 100;
  const double spacing_m = (w.newest().path_m - w.at(0).path_m) / std::max(1, w.size() - 1);
  return std::clamp(kGroundStretch_m / std::max(spacing_m, kGroundStretch_m / kMost), 1.0, kMost);
}

/// Shares by what each track knows of its depth at the present states.
void weigh(const Window& w, int k, const HeightReading& reading, const BeamSettings& s, BeamTracks& out) {
  const Vec3 end = w.at(k).x.p + w.at(k).x.R * reading.lever_B, o = camera_of(w, k);
  double information = 0;
  out.shares.fill(0);
  out.drop_m = o.z() - end.z();
  for (std::size_t i = 0; i < static_cast<std::size_t>(out.count); ++i) {
    const int track = w.find(out.ids[i]);
    if (track < 0) continue;
    const Depth d = depth_of(w, w.track(track), k, w.size());
    if (!d.found) continue;
    const double by_bearing = s.sigma_rad * out.drop_m * out.drop_m, most = kMostRelative * out.drop_m;
    const double depth = by_bearing * by_bearing * d.m.squaredNorm() * d.lambda.z();
    if (!(depth < most * most)) continue;
    const double ground = s.ground_walk * s.ground_walk * (out.drop_m * d.m + o - end).head<2>().norm();
    out.shares[i] = 1 / (depth + ground);
    information += out.shares[i];
  }
  const double noise = s.range_sigma_m * s.range_sigma_m + s.ground_m * s.ground_m * frames_per_stretch(w);
  out.variance = information > 0 ? 1 / information + noise : 0;
  for (double& share : out.shares) share = information > 0 ? share / information : 0;
}

/// Adds g * d rho / d (p, theta) of every frame that sees the track; returns g * d rho / d o, of the camera of frame k.
Vec3 add_slopes(const Window& w, const TrackRecord& t, int frames, const Depth& d, const Vec3& o, double g,
                std::array<Vec6, kMaxFrames>& J) {
  const Vec3& lever = w.calibration.p_BC;
  Vec3 by_o = Vec3::Zero();
  each_view(w, t, frames, [&](int j, const Ray& ray) {
    const Vec3 &f = ray.f, Y = d.m + d.rho * (o - ray.c), q = by_depth(o - ray.c) * d.lambda;
    const Vec3 e = Y - f * f.dot(Y), across = q - f * f.dot(q);
    const Vec3 by_c = g * (d.rho * across + d.lambda.z() * e), by_f = g * (f.dot(Y) * q + f.dot(q) * Y);
    const Mat3 R_WB = w.at(j).x.R;
    Vec6& to = J[static_cast<std::size_t>(j)];
    to.head<3>() += by_c;
    to.tail<3>() += lever.cross(R_WB.transpose() * by_c) + (R_WB.transpose() * f).cross(R_WB.transpose() * by_f);
    by_o -= by_c;
  });
  return by_o;
}

}  // namespace

void choose_beam_tracks(Window& w, const BeamSettings& settings, std::span<const std::uint32_t> used) {
  for (int k = 0; k < w.size(); ++k) {
    const HeightReading& reading = w.at(k).heights[kRange];
    if (!reading.has) continue;
    BeamTracks& tracks = w.at(k).beam;
    if (tracks.count == 0) look_for_tracks(w, k, reading, used, tracks);
    if (tracks.count > 0) weigh(w, k, reading, settings, tracks);
  }
}

void evaluate_beam(const Window& w, int k, int frames, bool with_slopes, BeamResidual& out) {
  const HeightReading& reading = w.at(k).heights[kRange];
  const BeamTracks& tracks = w.at(k).beam;
  out.active = false;
  if (!(tracks.variance > 0)) return;
  if (with_slopes) out.J.fill(Vec6::Zero());
  const NavState& x = w.at(k).x;
  const Vec3 o = camera_of(w, k);
  const double above_end = o.z() - height_offset(reading, x);
  double rho = 0, shares = 0;
  Vec3 by_o = Vec3::Zero();
  for (std::size_t i = 0; i < tracks.ids.size(); ++i) {
    const int track = tracks.shares[i] > 0 ? w.find(tracks.ids[i]) : -1;
    if (track < 0) continue;
    const TrackRecord& t = w.track(track);
    const Depth d = depth_of(w, t, k, frames);
    if (!d.found) continue;
    const double share = tracks.drop_m * tracks.shares[i];
    rho += share * d.rho;
    shares += share;
    if (with_slopes) by_o += add_slopes(w, t, frames, d, o, share * above_end, out.J);
  }
  if (!(shares > 0)) return;
  out.active = true;
  out.r = rho * above_end - shares;
  if (!with_slopes) return;
  by_o.z() += rho;
  Vec6& J = out.J[static_cast<std::size_t>(k)];
  J.head<3>() += by_o;
  J.tail<3>() += w.calibration.p_BC.cross(x.R.transpose() * by_o);
  J -= rho * height_jacobian(reading, x.R);
}

double add_beam(const Window& w, const Share& share, NormalEquations* out) {
  double cost = 0;
  BeamResidual f;
  const int end = share.oldest_only ? 1 : share.frames;
  for (int k = 0; k < end; ++k) {
    evaluate_beam(w, k, share.frames, out != nullptr, f);
    if (!f.active) continue;
    constexpr double kCauchySquared = kCauchyBeam * kCauchyBeam;
    const double s = f.r * f.r / (w.at(k).beam.variance * kCauchySquared);
    cost += kCauchySquared * std::log1p(s);
    if (out == nullptr) continue;
    const double weight = 1 / (w.at(k).beam.variance * (1 + s));
    for (int j = 0; j < share.frames; ++j) {
      const Vec6& J_j = f.J[static_cast<std::size_t>(j)];
      if (J_j.isZero(0)) continue;
      out->add(pose_of(j), Vec6(-weight * f.r * J_j));
      for (int l = 0; l <= j; ++l) {
        const Vec6& J_l = f.J[static_cast<std::size_t>(l)];
        if (!J_l.isZero(0)) out->add(pose_of(j), pose_of(l), (weight * J_j * J_l.transpose()).eval());
      }
    }
  }
  return cost;
}

}  // namespace epiline
