#pragma once
// The inner loop of the renderer: rays against a short list of panels, and the texture where they hit.
#include <array>
#include <cstdint>

#include "drivers/laboratory/render/texture.h"

namespace epiline {

/// Pixels side by side that are traced together.
inline constexpr int kTileSize = 16;

/// A panel from one camera pose, in C: a ray f hits its plane at t = distance / (normal . f), at the panel's
/// coordinates (u0, v0) + t (e_u . f, e_v . f), in m.
struct PanelInView {
  std::array<float, 3> normal, e_u, e_v;
  float distance, u0, v0, half_u, half_v;
};

/// How the panels of a list look, by their place in it.
struct PanelLooks {
  static constexpr int kCapacity = 1024;
  std::array<float, kCapacity> nearest;               ///< no ray hits it closer than this, m; ascending
  std::array<float, kCapacity> texels_per_m, x0, y0;  ///< texel = (x0, y0) + texels_per_m (u, v)
  std::array<float, kCapacity> shade;
  std::array<float, kCapacity> gloss, facing;   ///< strength of the highlight; cosine between normal and lamp
  std::array<std::int32_t, kCapacity> texture;  ///< byte offset in the atlas
};

/// Where inside a pixel, and from which pose, a ray starts.
struct RaySample {
  float dx, dy;  ///< px from the pixel's centre
  const PanelInView* panels;
  std::array<float, 3> lamp;  ///< direction of the light that highlights mirror, in C
};

/// Unit bearings of pixels, one plane for each coordinate: `at[k]` points at the first pixel of the row, `stride`
/// floats lead to the next row. A zero bearing hits nothing. One pixel beyond the row's ends and one row above and
/// below can be read.
struct BearingRow {
  std::array<const float*, 3> at;
  std::ptrdiff_t stride;
};

struct TraceJob {
  BearingRow bearings;
  const RaySample* samples;  ///< the first `inner_samples` of them suffice where all rays meet the same panel
  int inner_samples, sample_count;
  const PanelLooks* looks;
  int panel_count;
  const std::uint8_t* atlas;
  float pixel_rad;  ///< angle between the rays of a pixel that count as neighbours: sets the mip level
  float sky;        ///< radiance where there is nothing
};

/// Mean radiance over the samples for kTileSize pixels of a row.
void trace_row(const TraceJob& job, float* radiance) noexcept;

/// What a sensor makes of radiance.
struct SensorRow {
  const float* radiance;
  const float* vignette;  ///< share of the light that arrives, for each pixel
  float gain;             ///< grey levels per radiance
  float read_sigma;       ///< noise in the dark, grey levels
  float shot_factor;      ///< variance per grey level of signal
  std::uint32_t seed;     ///< another row, another seed
};

/// Grey levels of a row: `width` rounded up to kTileSize are read and written.
void expose_row(const SensorRow& row, int width, std::uint8_t* out) noexcept;

}  // namespace epiline
