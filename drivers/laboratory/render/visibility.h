#pragma once
// Which panels a block or a tile of pixels may show, so that each ray is compared with few of them.
#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "drivers/laboratory/render/texture.h"
#include "drivers/laboratory/render/trace.h"
#include "drivers/laboratory/render/world.h"
#include "estimator/geometry/camera.h"

namespace epiline {

using Vec3f = Eigen::Vector3f;
using Mat3f = Eigen::Matrix3f;

/// Unit bearings of all pixels and of a border around them, as planes; zero where the lens sees nothing.
class BearingTable {
 public:
  explicit BearingTable(const Camera& camera);
  int padded_width() const { return width_; }
  BearingRow row(int x, int y) const {
    return {{&planes_[0][index(x, y)], &planes_[1][index(x, y)], &planes_[2][index(x, y)]}, stride_};
  }
  Vec3f at(int x, int y) const {
    const std::size_t i = index(std::clamp(x, -1, width_), std::clamp(y, -1, height_));
    return {planes_[0][i], planes_[1][i], planes_[2][i]};
  }

 private:
  std::size_t index(int x, int y) const { return static_cast<std::size_t>((y + 1) * stride_ + x + 1); }
  int width_, height_, stride_;
  std::array<std::vector<float>, 3> planes_;
};

/// A panel in single precision, relative to a place near the camera.
struct NearPanel {
  Vec3f centre, e_u, e_v, normal;
  float half_u, half_v;
  float nearest;  ///< distance of its closest point, m
  float texels_per_m, x0, y0, shade, gloss, facing;
  std::int32_t texture;
  Vec3f corner(int i) const {
    return centre + ((i & 1) != 0 ? half_u : -half_u) * e_u + ((i & 2) != 0 ? half_v : -half_v) * e_v;
  }
};

/// The panels that face `eye`, nearest first.
std::vector<NearPanel> facing_panels(const std::vector<Panel>& panels, const TextureAtlas& atlas, const Vec3& eye,
                                     double slack_m);

/// A panel as the inner loop wants it, from one pose; `p`: the pose's position relative to the place the panel is
/// relative to.
PanelInView panel_in_view(const NearPanel& panel, const Mat3f& R_CW, const Vec3f& p);

/// Of a camera, its position relative to the place that panels are relative to.
struct PoseF {
  Mat3f R_CW;
  Vec3f p;
};

/// Directions that hold everything a block of pixels sees while it is exposed.
struct Cone {
  Vec3f axis;
  float cosine, sine;
  bool is_everything;

  bool may_see(const NearPanel& panel, const PoseF& pose) const;
};
Cone cone_around(const BearingTable& bearings, int x0, int y0, int x1, int y1, double pad_rad);

/// Between which distances rays can meet a panel; `far_m` is finite only if all of them do.
struct Reach {
  float near_m, far_m;
};

/// The four planes around a tile's pixels, through the camera; their normals point inwards.
struct Pyramid4 {
  std::array<Vec3f, 4> inward;
  std::array<Vec3f, 4> edge;  ///< rays a little outside of its corners
  bool is_everything;

  bool may_see(const NearPanel& panel, const PoseF& pose) const;

  /// Over a plane, one over the distance is linear in the direction: its extremes are at the edges. `slack_m`: how far
  /// the camera moves meanwhile.
  Reach reach(const NearPanel& panel, const PoseF& pose, float slack_m) const;
};
Pyramid4 pyramid_around(const BearingTable& bearings, int x0, int y0, double pad_rad);

}  // namespace epiline
