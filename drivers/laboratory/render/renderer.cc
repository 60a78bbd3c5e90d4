#include "drivers/laboratory/render/renderer.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "drivers/flights/motion/random.h"
#include "drivers/laboratory/render/visibility.h"

namespace epiline {
namespace {

constexpr int kBlockTiles = 4;                        ///< tiles along the side of a block
constexpr int kMostSamples = 16, kFewestSamples = 4;  ///< inside a surface
constexpr int kEdgeFactor = 3;                        ///< where there is an edge, so many times as many
constexpr double kBlurPerSample_px = 1.5;

struct CameraPose {
  Mat3 R_WC;
  Vec3 p_WC;
};

CameraPose camera_pose(const MotionModel& motion, const RenderSettings& s, double t_s) {
  const Motion m = motion.at(std::clamp(t_s, 0.0, motion.duration_s()));
  return {m.R_WB * s.R_BC, m.p_WB + m.R_WB * s.p_BC};
}

/// Where in a pixel and when during the exposure a ray is cast.
struct Sampling {
  float dx, dy;   ///< px, for a pixel one wide
  double moment;  ///< -0.5 to 0.5
};

/// `count` samples that fill a pixel evenly whatever their number (the plastic number's sequence) and the exposure in
/// equal steps; in the mean they are the pixel's centre at the middle of the exposure.
void append_samples(int count, std::vector<Sampling>& samples) {
  const std::size_t begin = samples.size();
  double x_mean = 0, y_mean = 0;
  for (int s = 0; s < count; ++s) {
    const double n = static_cast<double>(begin) + s, x = 0.7548776662466927 * n, y = 0.5698402909980532 * n;
    samples.push_back(
        {static_cast<float>(x - std::floor(x)), static_cast<float>(y - std::floor(y)), (s + 0.5) / count - 0.5});
    x_mean += (x - std::floor(x)) / count;
    y_mean += (y - std::floor(y)) / count;
  }
  for (std::size_t i = begin; i < samples.size(); ++i) {
    samples[i].dx -= static_cast<float>(x_mean);
    samples[i].dy -= static_cast<float>(y_mean);
  }
}

}  // namespace

std::optional<RayHit> cast_ray(const World& world, const Vec3& origin, const Vec3& direction) {
  std::optional<RayHit> best;
  for (std::size_t i = 0; i < world.panels.size(); ++i) {
    const Panel& p = world.panels[i];
    const double slope = p.normal().dot(direction);
    if (slope >= 0) continue;
    const double t = p.normal().dot(p.centre - origin) / slope;
    if (t <= 0 || (best && t >= best->distance_m)) continue;
    const Vec3 at = origin + t * direction - p.centre;
    if (std::abs(at.dot(p.e_u)) <= p.half_u && std::abs(at.dot(p.e_v)) <= p.half_v) best = RayHit{i, t};
  }
  return best;
}

struct Renderer::Impl {
  const World& world;
  const TextureAtlas& atlas;
  const MotionModel& motion;
  RenderSettings settings;
  Camera camera;
  BearingTable bearings;
  std::vector<float> vignette;
  std::vector<double> times_s;
  std::vector<Exposure> exposures;

  Impl(const World& w, const TextureAtlas& a, const MotionModel& m, const RenderSettings& s,
       const std::vector<double>& times)
      : world(w), atlas(a), motion(m), settings(s), camera(s.camera), bearings(camera), times_s(times) {
    make_vignette();
    plan_exposures();
  }

  void make_vignette() {
    vignette.assign(static_cast<std::size_t>(bearings.padded_width()) * camera.height(), 0);
    const double cx = 0.5 * (camera.width() - 1), cy = 0.5 * (camera.height() - 1);
    for (int y = 0; y < camera.height(); ++y) {
      for (int x = 0; x < camera.width(); ++x) {
        const double r2 = ((x - cx) * (x - cx) + (y - cy) * (y - cy)) / (cx * cx + cy * cy);
        const bool sees = !bearings.at(x, y).isZero();
        vignette[static_cast<std::size_t>(y) * bearings.padded_width() + x] =
            sees ? static_cast<float>(1 - settings.effects.vignette * r2) : 0;
      }
    }
  }

  /// Radiance over a coarse grid of pixels.
  double mean_radiance(double t_s) const {
    const CameraPose pose = camera_pose(motion, settings, t_s);
    constexpr int kColumns = 12, kRows = 8;
    double sum = 0;
    int count = 0;
    for (int j = 0; j < kRows; ++j) {
      for (int i = 0; i < kColumns; ++i) {
        const Vec3f f =
            bearings.at((2 * i + 1) * camera.width() / (2 * kColumns), (2 * j + 1) * camera.height() / (2 * kRows));
        if (f.isZero()) continue;
        const auto hit = cast_ray(world, pose.p_WC, pose.R_WC * f.cast<double>());
        sum += hit ? world.panels[hit->panel].shade * atlas.mean(world.panels[hit->panel].material) : world.sky;
        ++count;
      }
    }
    return std::max(1.0, sum / std::max(1, count));
  }

  /// Exposure settings for all images: the scene's brightness is brought to a level, slowly; time first, then gain.
  void plan_exposures() {
    constexpr double kLevel = 100, kLag_s = 0.3, kPlanned_s = 0.1;
    exposures.resize(times_s.size());
    if (times_s.empty()) return;
    std::vector<double> wanted(times_s.size());
    double planned_at = -1e9;
    for (std::size_t i = 0; i < times_s.size(); ++i) {
      const bool plan = times_s[i] - planned_at >= kPlanned_s;
      wanted[i] = plan ? kLevel / mean_radiance(times_s[i]) : wanted[i - 1];
      if (plan) planned_at = times_s[i];
    }
    std::vector<double> sorted = wanted;
    std::nth_element(sorted.begin(), sorted.begin() + sorted.size() / 2, sorted.end());
    const double usual = sorted[sorted.size() / 2];
    const CameraEffects& e = settings.effects;
    double now = e.auto_exposure ? wanted[0] : usual;
    for (std::size_t i = 0; i < times_s.size(); ++i) {
      if (e.auto_exposure && i > 0) {
        const double share = 1 - std::exp(-(times_s[i] - times_s[i - 1]) / kLag_s);
        now *= std::pow(wanted[i - 1] / now, share);
      }
      const double relative = now / usual;
      const double stretch = e.auto_exposure ? std::clamp(relative, 0.3, 1.8) : 1;
      exposures[i] = {e.exposure_s * stretch, now, relative / stretch};
    }
  }

  int sample_count(double t_s, double exposure_s) const {
    const Motion m = motion.at(std::clamp(t_s, 0.0, motion.duration_s()));
    constexpr double kUsualDepth_m = 2;
    const double rad = exposure_s * (m.omega_B.norm() + m.v_WB.norm() / kUsualDepth_m);
    return std::clamp(static_cast<int>(std::ceil(rad * camera.focal_px() / kBlurPerSample_px)), kFewestSamples,
                      kMostSamples);
  }

  void render(std::size_t i, std::uint8_t* pixels) const;
};

namespace {

/// One image in the making.
struct Picture {
  const Renderer::Impl& r;
  double t_s, exposure_s, pad_rad, slack_m;
  int inner_samples;
  std::vector<Sampling> sampling;  ///< the inner ones first, then those for edges
  Vec3 eye;                        ///< what all positions are relative to
  std::vector<NearPanel> panels;

  struct Candidate {
    const NearPanel* panel;
    float nearest;
  };
  std::vector<const NearPanel*> in_block;
  std::vector<Candidate> in_tile;
  std::vector<PoseF> poses;  ///< of the samples
  std::vector<PanelInView> views;
  std::vector<RaySample> rays;
  PanelLooks looks{};  ///< also read, for nothing, where no ray hits

  Picture(const Renderer::Impl& renderer, std::size_t i);
  double row_time(int y) const { return t_s + (y - 0.5 * (r.camera.height() - 1)) * r.settings.effects.row_time_s; }
  PoseF pose_at(double time_s) const {
    const CameraPose pose = camera_pose(r.motion, r.settings, time_s);
    return {pose.R_WC.transpose().cast<float>(), (pose.p_WC - eye).cast<float>()};
  }
  void find_candidates(const Pyramid4& pyramid, const PoseF& pose);
  void look_at_panels();
  void view_panels(int y);
  void trace_tile(int x0, int y0, float* radiance, int stride);
  void trace_block(int x0, int y0, float* radiance, int stride);
};

Picture::Picture(const Renderer::Impl& renderer, std::size_t i)
    : r(renderer),
      t_s(r.times_s[i]),
      exposure_s(r.exposures[i].time_s),
      inner_samples(r.sample_count(t_s, exposure_s)) {
  append_samples(inner_samples, sampling);
  append_samples((kEdgeFactor - 1) * inner_samples, sampling);
  const CameraEffects& e = r.settings.effects;
  const Motion m = r.motion.at(std::clamp(t_s, 0.0, r.motion.duration_s()));
  eye = camera_pose(r.motion, r.settings, t_s).p_WC;
  const double half_image_s = 0.5 * (exposure_s + r.camera.height() * std::abs(e.row_time_s));
  const double half_tile_s = 0.5 * (exposure_s + kTileSize * std::abs(e.row_time_s));
  constexpr double kClosest_m = 0.3;
  const double speed = m.v_WB.norm() + m.omega_B.norm() * r.settings.p_BC.norm();
  pad_rad = 1.2 * half_tile_s * (m.omega_B.norm() + speed / kClosest_m) + (1 + e.lens_blur_px) / r.camera.focal_px();
  slack_m = 0.001 + 1.5 * half_image_s * speed;
  std::vector<Panel> all = r.world.panels;
  for (const Mover& mover : r.world.movers) {
    const Vec3 centre = mover.centre(t_s);
    if ((centre - eye).norm() < mover.size.norm()) continue;  // not through the camera
    for (Panel p : mover.panels) {
      p.centre += centre;
      all.push_back(p);
    }
  }
  panels = facing_panels(all, r.atlas, eye, slack_m);
}

/// The panels that may show in a tile and are not all behind one that covers it, nearest first.
void Picture::find_candidates(const Pyramid4& pyramid, const PoseF& pose) {
  in_tile.clear();
  float horizon = std::numeric_limits<float>::infinity();
  for (const NearPanel* p : in_block) {
    if (p->nearest > horizon) break;  // and all after it
    if (!pyramid.may_see(*p, pose)) continue;
    const Reach reach = pyramid.reach(*p, pose, static_cast<float>(slack_m));
    horizon = std::min(horizon, reach.far_m);
    in_tile.push_back({p, reach.near_m});
  }
  std::erase_if(in_tile, [&](const Candidate& c) { return c.nearest > horizon; });
  std::stable_sort(in_tile.begin(), in_tile.end(),
                   [](const Candidate& a, const Candidate& b) { return a.nearest < b.nearest; });
  if (in_tile.size() > PanelLooks::kCapacity) in_tile.resize(PanelLooks::kCapacity, {});
}

void Picture::look_at_panels() {
  for (std::size_t k = 0; k < in_tile.size(); ++k) {
    const NearPanel& p = *in_tile[k].panel;
    looks.nearest[k] = in_tile[k].nearest;
    looks.texels_per_m[k] = p.texels_per_m;
    looks.x0[k] = p.x0;
    looks.y0[k] = p.y0;
    looks.shade[k] = p.shade;
    looks.gloss[k] = p.gloss;
    looks.facing[k] = p.facing;
    looks.texture[k] = p.texture;
  }
}

/// The tile's panels from the poses in which row `y` is exposed.
void Picture::view_panels(int y) {
  const auto lens = static_cast<float>(r.settings.effects.lens_blur_px);
  views.resize(in_tile.size() * sampling.size());
  rays.clear();
  if (poses.empty() || r.settings.effects.row_time_s != 0) {
    poses.clear();
    for (const Sampling& s : sampling) poses.push_back(pose_at(row_time(y) + exposure_s * s.moment));
  }
  for (std::size_t i = 0; i < sampling.size(); ++i) {
    const Sampling& s = sampling[i];
    const PoseF& pose = poses[i];
    PanelInView* out = views.data() + in_tile.size() * rays.size();
    for (std::size_t k = 0; k < in_tile.size(); ++k) out[k] = panel_in_view(*in_tile[k].panel, pose.R_CW, pose.p);
    const Vec3f lamp = pose.R_CW * kLamp_W.cast<float>();
    rays.push_back({lens * s.dx, lens * s.dy, out, {lamp.x(), lamp.y(), lamp.z()}});
  }
}

void Picture::trace_tile(int x0, int y0, float* radiance, int stride) {
  const int rows = std::min(kTileSize, r.camera.height() - y0);
  const Pyramid4 pyramid = pyramid_around(r.bearings, x0, y0, pad_rad);
  find_candidates(pyramid, pose_at(row_time(y0 + rows / 2)));
  look_at_panels();
  for (int y = y0; y < y0 + rows; ++y) {
    if (y == y0 || r.settings.effects.row_time_s != 0) view_panels(y);
    const TraceJob job{r.bearings.row(x0, y),
                       rays.data(),
                       inner_samples,
                       static_cast<int>(rays.size()),
                       &looks,
                       static_cast<int>(in_tile.size()),
                       r.atlas.data(),
                       static_cast<float>(0.8 / r.camera.focal_px()),
                       static_cast<float>(r.world.sky)};
    trace_row(job, radiance + static_cast<std::ptrdiff_t>(y) * stride + x0);
  }
}

void Picture::trace_block(int x0, int y0, float* radiance, int stride) {
  const int x1 = std::min(x0 + kBlockTiles * kTileSize, r.bearings.padded_width());
  const int y1 = std::min(y0 + kBlockTiles * kTileSize, r.camera.height());
  const PoseF pose = pose_at(row_time((y0 + y1) / 2));
  const double more_rows = kBlockTiles;  // a block is exposed over more rows than a tile
  const Cone cone = cone_around(r.bearings, x0 - 1, y0 - 1, x1, y1, more_rows * pad_rad);
  in_block.clear();
  for (const NearPanel& p : panels)
    if (cone.may_see(p, pose)) in_block.push_back(&p);
  for (int y = y0; y < y1; y += kTileSize)
    for (int x = x0; x < x1; x += kTileSize) trace_tile(x, y, radiance, stride);
}

}  // namespace

void Renderer::Impl::render(std::size_t i, std::uint8_t* pixels) const {
  const int width = camera.width(), height = camera.height(), stride = bearings.padded_width();
  std::vector<float> radiance(static_cast<std::size_t>(stride) * height);
  Picture picture(*this, i);
  for (int y = 0; y < height; y += kBlockTiles * kTileSize)
    for (int x = 0; x < stride; x += kBlockTiles * kTileSize) picture.trace_block(x, y, radiance.data(), stride);
  const Exposure& e = exposures[i];
  const auto seed = static_cast<std::uint32_t>(Random(settings.seed, 600 + i).uniform() * 4294967296.0);
  std::vector<std::uint8_t> row(stride);
  for (int y = 0; y < height; ++y) {
    const std::size_t begin = static_cast<std::size_t>(y) * stride;
    expose_row(
        {&radiance[begin], &vignette[begin], static_cast<float>(e.gain),
         static_cast<float>(settings.effects.read_sigma * e.amplification),
         static_cast<float>(settings.effects.shot_factor * e.amplification), seed + static_cast<std::uint32_t>(begin)},
        stride, row.data());
    std::copy_n(row.data(), width, pixels + static_cast<std::ptrdiff_t>(y) * width);
  }
}

Renderer::Renderer(const World& world, const TextureAtlas& atlas, const MotionModel& motion,
                   const RenderSettings& settings, const std::vector<double>& times_s)
    : impl_(std::make_unique<Impl>(world, atlas, motion, settings, times_s)) {}
Renderer::~Renderer() = default;

void Renderer::render(std::size_t i, std::uint8_t* pixels) const { impl_->render(i, pixels); }
const Exposure& Renderer::exposure(std::size_t i) const { return impl_->exposures[i]; }

}  // namespace epiline
