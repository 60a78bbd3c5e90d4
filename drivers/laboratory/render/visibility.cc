#include "drivers/laboratory/render/visibility.h"

#include <cmath>
#include <limits>

namespace epiline {

BearingTable::BearingTable(const Camera& camera)
    : width_((camera.width() + kTileSize - 1) / kTileSize * kTileSize), height_(camera.height()), stride_(width_ + 2) {
  for (auto& plane : planes_) plane.resize(static_cast<std::size_t>(stride_) * (height_ + 2));
  for (int y = -1; y <= height_; ++y) {
    for (int x = -1; x <= width_; ++x) {
      Vec3 f = Vec3::Zero();
      if (!camera.unproject(Vec2(x, y), f)) f.setZero();
      for (int k = 0; k < 3; ++k) planes_[k][index(x, y)] = static_cast<float>(f[k]);
    }
  }
}

std::vector<NearPanel> facing_panels(const std::vector<Panel>& panels, const TextureAtlas& atlas, const Vec3& eye,
                                     double slack_m) {
  std::vector<NearPanel> list;
  for (const Panel& p : panels) {
    const Vec3 to_centre = p.centre - eye;
    const Vec3 normal = p.normal();
    if (normal.dot(to_centre) > slack_m) continue;
    const double u = std::clamp(-to_centre.dot(p.e_u), -p.half_u, p.half_u);
    const double v = std::clamp(-to_centre.dot(p.e_v), -p.half_v, p.half_v);
    const double nearest = (to_centre + u * p.e_u + v * p.e_v).norm() - slack_m;
    list.push_back({to_centre.cast<float>(), p.e_u.cast<float>(), p.e_v.cast<float>(), normal.cast<float>(),
                    static_cast<float>(p.half_u), static_cast<float>(p.half_v), static_cast<float>(nearest),
                    static_cast<float>(p.texels_per_m), static_cast<float>(p.texture_origin.x()),
                    static_cast<float>(p.texture_origin.y()), static_cast<float>(p.shade),
                    static_cast<float>(gloss_of(p.material)), static_cast<float>(normal.dot(kLamp_W)),
                    atlas.offset(p.material)});
  }
  std::stable_sort(list.begin(), list.end(),
                   [](const NearPanel& a, const NearPanel& b) { return a.nearest < b.nearest; });
  return list;
}

PanelInView panel_in_view(const NearPanel& panel, const Mat3f& R_CW, const Vec3f& p) {
  const auto array = [](const Vec3f& v) { return std::array<float, 3>{v.x(), v.y(), v.z()}; };
  const Vec3f back = p - panel.centre;
  const float distance = -panel.normal.dot(back);
  return {array(R_CW * panel.normal),
          array(R_CW * panel.e_u),
          array(R_CW * panel.e_v),
          distance,
          panel.e_u.dot(back),
          panel.e_v.dot(back),
          distance < 0 ? panel.half_u : -1,  // from behind it is invisible
          panel.half_v};
}

bool Cone::may_see(const NearPanel& panel, const PoseF& pose) const {
  if (is_everything) return true;
  const Vec3f centre = pose.R_CW * (panel.centre - pose.p);
  const float radius = std::hypot(panel.half_u, panel.half_v), along = axis.dot(centre);
  const float across = std::sqrt(std::max(0.0F, centre.squaredNorm() - along * along));
  return across * cosine - along * sine < radius;  // distance of the centre from the cone's surface
}

Cone cone_around(const BearingTable& bearings, int x0, int y0, int x1, int y1, double pad_rad) {
  Vec3f sum = Vec3f::Zero();
  std::array<Vec3f, 8> edge;
  const int xm = (x0 + x1) / 2, ym = (y0 + y1) / 2;
  const int xs[8] = {x0, xm, x1, x0, x1, x0, xm, x1}, ys[8] = {y0, y0, y0, ym, ym, y1, y1, y1};
  for (int i = 0; i < 8; ++i) {
    edge[i] = bearings.at(xs[i], ys[i]);
    if (edge[i].isZero()) return {Vec3f::UnitZ(), -1, 0, true};
    sum += edge[i];
  }
  const Vec3f axis = sum.normalized();
  double widest = 0;
  for (const Vec3f& f : edge) widest = std::max(widest, std::acos(std::min(1.0, static_cast<double>(axis.dot(f)))));
  const double angle = 1.05 * widest + pad_rad;
  if (angle > 1.5) return {axis, -1, 0, true};
  return {axis, static_cast<float>(std::cos(angle)), static_cast<float>(std::sin(angle)), false};
}

bool Pyramid4::may_see(const NearPanel& panel, const PoseF& pose) const {
  if (is_everything) return true;
  Vec3f corner[4];
  for (int i = 0; i < 4; ++i) corner[i] = pose.R_CW * (panel.corner(i) - pose.p);
  return std::all_of(inward.begin(), inward.end(), [&](const Vec3f& n) {
    return std::any_of(corner, corner + 4, [&](const Vec3f& c) { return n.dot(c) > 0; });
  });
}

Reach Pyramid4::reach(const NearPanel& panel, const PoseF& pose, float slack_m) const {
  constexpr float kNever = std::numeric_limits<float>::infinity(), kMargin = 0.95F;
  if (is_everything) return {panel.nearest, kNever};
  const Vec3f centre = pose.R_CW * (panel.centre - pose.p), normal = pose.R_CW * panel.normal;
  const Vec3f e_u = pose.R_CW * panel.e_u, e_v = pose.R_CW * panel.e_v;
  const float distance = normal.dot(centre);
  float most = 0, least = kNever;
  bool covered = distance < -slack_m;
  for (const Vec3f& f : edge) {
    const float inverse = normal.dot(f) / distance;
    most = std::max(most, inverse);
    least = std::min(least, inverse);
    const Vec3f at = f / inverse - centre;
    covered = covered && inverse > 0 && std::abs(e_u.dot(at)) + slack_m < panel.half_u &&
              std::abs(e_v.dot(at)) + slack_m < panel.half_v;
  }
  const float near_m = most > 0 ? kMargin / most - slack_m : kNever;
  return {std::max(panel.nearest, near_m), covered ? 1 / (kMargin * least) + slack_m : kNever};
}

Pyramid4 pyramid_around(const BearingTable& bearings, int x0, int y0, double pad_rad) {
  const int x1 = x0 + kTileSize, y1 = y0 + kTileSize;
  const Vec3f corner[4] = {bearings.at(x0 - 1, y0 - 1), bearings.at(x1, y0 - 1), bearings.at(x1, y1),
                           bearings.at(x0 - 1, y1)};
  const Vec3f middle = bearings.at(x0 + kTileSize / 2, y0 + kTileSize / 2);
  Pyramid4 pyramid{};
  pyramid.is_everything = middle.isZero() || std::any_of(corner, corner + 4, [](const Vec3f& f) { return f.isZero(); });
  if (pyramid.is_everything) return pyramid;
  for (int i = 0; i < 4; ++i) {
    Vec3f n = corner[i].cross(corner[(i + 1) % 4]).normalized();
    if (n.dot(middle) < 0) n = -n;
    // Tilted outwards by the pad: the normal leans towards the middle.
    pyramid.inward[i] = (n + static_cast<float>(std::tan(pad_rad)) * middle).normalized();
    pyramid.edge[i] = corner[i] + 1.5F * static_cast<float>(pad_rad) * (corner[i] - middle).normalized();
  }
  return pyramid;
}

}  // namespace epiline
