#include "estimator/factors/height.h"

#include "estimator/geometry/so3.h"

namespace epiline {

namespace {

constexpr double kCauchy = 3;  // scale of the kernel, in sigmas; jumps are taken out before

/// Of the offsets: cost, and with the slopes of them half its gradient and curvature.
struct OffsetSystem {
  double cost = 0;
  std::array<double, kMaxFrames> g{};
  std::array<std::array<double, kMaxFrames>, kMaxFrames> H{};  ///< symmetric
};

void add(const HeightInnovation& i, const std::array<double, kMaxFrames>& offsets, int frames, bool with_slopes,
         OffsetSystem& out) {
  double r = 0;
  for (int j = i.frame; j < frames; ++j)
    r += i.share[static_cast<std::size_t>(j)] * offsets[static_cast<std::size_t>(j)];
  constexpr double kCauchySquared = kCauchy * kCauchy;
  const double s = r * r / (i.variance * kCauchySquared);
  out.cost += kCauchySquared * std::log1p(s);
  if (!with_slopes) return;
  const double weight = 1 / (i.variance * (1 + s));
  for (std::size_t j = 0; j < static_cast<std::size_t>(frames); ++j) {
    out.g[j] += weight * r * i.share[j];
    for (std::size_t l = 0; l < static_cast<std::size_t>(frames); ++l) out.H[j][l] += weight * i.share[j] * i.share[l];
  }
}

double add_sensor(const Window& w, HeightKind kind, const Share& share, NormalEquations* out) {
  const auto reading = [&](int k) -> const HeightReading& { return w.at(k).heights[static_cast<std::size_t>(kind)]; };
  std::array<double, kMaxFrames> offsets{};
  bool any = false;
  for (int k = 0; k < share.frames; ++k) {
    if (!reading(k).has) continue;
    any = true;
    offsets[static_cast<std::size_t>(k)] = height_offset(reading(k), w.at(k).x);
  }
  if (!any) return 0;
  OffsetSystem system;
  each_innovation(w, kind, share.frames, [&](const HeightInnovation& i) {
    if (!share.oldest_only || i.frame == 0) add(i, offsets, share.frames, out != nullptr, system);
  });
  if (out == nullptr) return system.cost;
  std::array<Vec6, kMaxFrames> J;
  for (int k = 0; k < share.frames; ++k)
    if (reading(k).has) J[static_cast<std::size_t>(k)] = height_jacobian(reading(k), w.at(k).x.R);
  for (int k = 0; k < share.frames; ++k) {
    if (!reading(k).has) continue;
    const auto row = static_cast<std::size_t>(k);
    out->add(pose_of(k), Vec6(-system.g[row] * J[row]));
    for (int l = 0; l <= k; ++l) {
      if (!reading(l).has) continue;
      const auto column = static_cast<std::size_t>(l);
      out->add(pose_of(k), pose_of(l), (system.H[row][column] * J[row] * J[column].transpose()).eval());
    }
  }
  return system.cost;
}

}  // namespace

double height_offset(const HeightReading& reading, const NavState& x) {
  return x.p.z() + x.R.row(2).dot(reading.lever_B) - reading.metres;
}

Vec6 height_jacobian(const HeightReading& reading, const Mat3& R) {
  Vec6 J = Vec6::Zero();
  J[2] = 1;
  J.tail<3>() = reading.lever_B.cross(R.row(2).transpose());
  return J;
}

double add_height(const Window& w, const Share& share, NormalEquations* out) {
  return add_sensor(w, HeightKind::kBarometer, share, out) + add_sensor(w, HeightKind::kRangeFinder, share, out);
}

}  // namespace epiline
