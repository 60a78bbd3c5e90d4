#include "estimator/factors/beam.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "estimator/factors/height.h"
#include "estimator/geometry/so3.h"

namespace epiline {

namespace {

constexpr double kCauchyBeam = 3;         // scale of the kernel, in sigmas
constexpr double kNearBeam = 0.985;       // cosine of 10 degrees: how far from the beam a track may be
constexpr double kMostRelative = 0.2;     // of the distance: tracks that know less of their depth are not used
constexpr double kLeastParallax = 1e-12;  // determinant of A over its size; below, all rays are parallel
constexpr int kLeastViews = 3;

constexpr std::size_t kRange = static_cast<std::size_t>(HeightKind::kRangeFinder);

/// The point nearest to all rays of a track.
struct Meeting {
  Vec3 X = Vec3::Zero();
  Mat3 A_inverse = Mat3::Zero();  ///< of A, the sum of the projections across the rays
  bool found = false;
};

struct Ray {
  Vec3 c, f;  ///< where the camera was, and the unit bearing; W
};
Ray ray_of(const Window& w, const NavState& x, const Observation& o) {
  return {x.p + x.R * w.calibration.p_BC, x.R * (w.calibration.R_BC * bearing_of(o))};
}

/// `state(j)`: where frame j is taken to be.
template <class State>
Meeting meeting(const Window& w, const TrackRecord& t, int frames, State&& state) {
  Mat3 A = Mat3::Zero();
  Vec3 b = Vec3::Zero();
  int views = 0;
  for (int j = 0; j < frames; ++j) {
    if (!w.seen(t, j)) continue;
    const Ray ray = ray_of(w, state(j), w.view(t, j));
    const Mat3 across = Mat3::Identity() - ray.f * ray.f.transpose();
    A += across;
    b += across * ray.c;
    ++views;
  }
  Meeting m;
  if (views < kLeastViews) return m;
  bool invertible = false;
  double determinant = 0;
  A.computeInverseAndDetWithCheck(m.A_inverse, determinant, invertible, kLeastParallax * views);
  m.X = m.A_inverse * b;
  m.found = invertible && m.X.allFinite();
  return m;
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

/// Shares by what each track knows of its height at the present states.
void weigh(const Window& w, int k, const HeightReading& reading, const BeamSettings& s, BeamTracks& out) {
  const double distance = reading.lever_B.norm(), most = kMostRelative * distance;
  const Vec3 end = w.at(k).x.p + w.at(k).x.R * reading.lever_B;
  double information = 0;
  out.shares.fill(0);
  for (std::size_t i = 0; i < static_cast<std::size_t>(out.count); ++i) {
    const int track = w.find(out.ids[i]);
    if (track < 0) continue;
    const Meeting m = meeting(w, w.track(track), w.size(), [&](int j) -> const NavState& { return w.at(j).x; });
    if (!m.found) continue;
    const double depth = s.sigma_rad * s.sigma_rad * distance * distance * m.A_inverse(2, 2);
    const double ground = s.ground_walk * s.ground_walk * (m.X - end).head<2>().norm();
    if (!(depth + ground < most * most)) continue;
    out.shares[i] = 1 / (depth + ground);
    information += out.shares[i];
  }
  const double noise = s.range_sigma_m * s.range_sigma_m + s.ground_m * s.ground_m * frames_per_stretch(w);
  out.variance = information > 0 ? 1 / information + noise : 0;
  for (double& share : out.shares) share = information > 0 ? share / information : 0;
}

/// Adds share * d X_z / d (p, theta) of every frame that sees the track.
void add_slopes(const Window& w, const TrackRecord& t, int frames, double share, std::array<Vec6, kMaxFrames>& J) {
  const Meeting m = meeting(w, t, frames, [&](int j) -> const NavState& { return w.at(j).x; });
  if (!m.found) return;
  const Vec3 row = share * m.A_inverse.row(2).transpose();
  for (int j = 0; j < frames; ++j) {
    if (!w.seen(t, j)) continue;
    const NavState& x = w.at(j).x;
    const Vec3 g = w.calibration.R_BC * bearing_of(w.view(t, j)), &lever = w.calibration.p_BC;
    const Vec3 f = x.R * g, y = x.p + x.R * lever - m.X;
    const Mat3 across = Mat3::Identity() - f * f.transpose();
    Vec6& to = J[static_cast<std::size_t>(j)];
    to.head<3>() += across * row;
    // dA (c - X) + A dc, with df = -R [g]x dtheta and dc = -R [p_BC]x dtheta
    const Mat3 turned = f.dot(y) * Mat3::Identity() + f * y.transpose();
    const Mat3 by_turn = turned * x.R * skew(g) - across * x.R * skew(lever);
    to.tail<3>() += by_turn.transpose() * row;
  }
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
  double height = 0, shares = 0;
  if (with_slopes) out.J.fill(Vec6::Zero());
  for (std::size_t i = 0; i < tracks.ids.size(); ++i) {
    const int track = tracks.shares[i] > 0 ? w.find(tracks.ids[i]) : -1;
    if (track < 0) continue;
    const TrackRecord& t = w.track(track);
    const Meeting m = meeting(w, t, frames, [&](int j) -> const NavState& { return w.at(j).x; });
    if (!m.found) continue;
    height += tracks.shares[i] * m.X.z();
    shares += tracks.shares[i];
    if (with_slopes) add_slopes(w, t, frames, tracks.shares[i], out.J);
  }
  if (!(shares > 0)) return;
  out.active = true;
  out.r = height - shares * height_offset(reading, w.at(k).x);
  if (with_slopes) out.J[static_cast<std::size_t>(k)] -= shares * height_jacobian(reading, w.at(k).x.R);
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
