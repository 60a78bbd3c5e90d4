#pragma once
// Images of a world as a moving camera sees it. Method and checks: docs/developers/simulation.md.
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "drivers/flights/motion/motion.h"
#include "drivers/laboratory/render/texture.h"
#include "drivers/laboratory/render/world.h"
#include "estimator/geometry/camera.h"

namespace epiline {

/// What the lens and the sensor do to an image.
struct CameraEffects {
  double exposure_s = 0.006;   ///< blurs what moves; 0: an instant
  double vignette = 0.35;      ///< light lost in the corners, share
  double read_sigma = 0.65;    ///< noise in the dark, grey levels at unit gain
  double shot_factor = 0.027;  ///< variance per grey level at unit gain
  double row_time_s = 0;       ///< rolling shutter: from a row to the next; the image's stamp is the middle row's
  bool auto_exposure = true;   ///< follows the scene's brightness with a lag; otherwise one setting for the flight
  double lens_blur_px = 1.6;   ///< width of the area a pixel gathers light from
};

/// Exposure of one image.
struct Exposure {
  double time_s = 0;
  double gain = 1;           ///< grey levels per radiance
  double amplification = 1;  ///< of the noise, against the flight's usual setting
};

struct RenderSettings {
  CameraParameters camera;
  Mat3 R_BC = Mat3::Identity();
  Vec3 p_BC = Vec3::Zero();
  CameraEffects effects;
  std::uint64_t seed = 1;
};

/// What one ray meets.
struct RayHit {
  std::size_t panel;  ///< index in World::panels
  double distance_m;
};

/// The panel a ray from `origin` along the unit vector `direction` meets first, movers left out.
std::optional<RayHit> cast_ray(const World& world, const Vec3& origin, const Vec3& direction);

/// Renders single images; one object serves any number of threads.
class Renderer {
 public:
  /// `world`, `atlas` and `motion` must outlive the renderer. `times_s`: when the flight's images are taken, ascending.
  Renderer(const World& world, const TextureAtlas& atlas, const MotionModel& motion, const RenderSettings& settings,
           const std::vector<double>& times_s);
  ~Renderer();

  /// Image `i` as 8-bit grey, rows without gaps: width * height bytes.
  void render(std::size_t i, std::uint8_t* pixels) const;
  const Exposure& exposure(std::size_t i) const;

  struct Impl;

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace epiline
