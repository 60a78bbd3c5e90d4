#include "pipeline/vision/klt.h"

#include <algorithm>
#include <cmath>

#include "pipeline/vision/simd.h"
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pipeline/vision/klt.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "pipeline/vision/patch-inl.h"

HWY_BEFORE_NAMESPACE();
namespace epiline::HWY_NAMESPACE {

struct Images {
  const TrackerConfig& config;
  const PyramidView& previous;
  const PyramidView& current;
};

struct Point {
  float x, y;
};

HWY_INLINE Point to_level(Point p, int level) {
  const float scale = 1.f / static_cast<float>(1 << level);
  return {(p.x + 0.5f) * scale - 0.5f, (p.y + 0.5f) * scale - 0.5f};
}

HWY_INLINE Point from_level(Point p, int level) {
  const float scale = static_cast<float>(1 << level);
  return {(p.x + 0.5f) * scale - 0.5f, (p.y + 0.5f) * scale - 0.5f};
}

// The template knows nothing of the contrast of the new image, and a step is wrong by that factor. A step compared with
// the one before it tells the factor (a secant along the step).
HWY_INLINE float secant_gain(float gain, Move step, Move last) {
  const float length2 = last.x * last.x + last.y * last.y;
  constexpr float kTooShort = 0.05f;  // px: below it the ratio is noise
  if (length2 <= kTooShort * kTooShort) return gain;
  return std::clamp(gain * (1.f - (step.x * last.x + step.y * last.y) / length2), 0.5f, 2.f);
}

// Improves `centre` (px of the level, of the quantised template). False: left the image, or the steps grow.
HWY_INLINE bool refine(const ImageView& image, const Template& t, float max_step, int iterations, float converged,
                       Point& centre) {
  float gain = 1.f, last_length2 = 1e9f;
  Move last{0.f, 0.f};
  for (int i = 0; i < iterations; ++i) {
    const Place at = quantise(centre.x, centre.y);
    if (!fits(image, at)) return false;
    const Move step = gauss_newton_step(image, at, t);
    const float length2 = step.x * step.x + step.y * step.y;
    if (!(length2 < max_step * max_step)) return false;
    if (length2 > 4.f * last_length2 && length2 > 0.25f) return false;
    if (i > 0) gain = secant_gain(gain, step, last);
    centre = {at.cx + step.x / gain, at.cy + step.y / gain};
    if (length2 < converged * converged) break;
    last = step;
    last_length2 = length2;
  }
  return true;
}

// One level forward: improves `found` (px of level 0) unless the level cannot say anything.
HWY_INLINE KltEnd track_level(const Images& images, int level, Point old, Template& t, Point& found) {
  const Point centre = to_level(old, level);
  const Place at = quantise(centre.x, centre.y);
  if (!fits(images.previous.level[level], at)) return KltEnd::kBorder;
  build_template(images.previous.level[level], at, centre.x, centre.y, t);
  const TrackerConfig& config = images.config;
  if (!(t.eigenvalue >= config.min_eigenvalue)) return KltEnd::kFlat;
  Point p = to_level(found, level);
  p = {p.x + t.offset_x, p.y + t.offset_y};
  const float converged = level == 0 ? config.step_px : config.coarse_step_px;
  if (!refine(images.current.level[level], t, config.max_step_px, config.iterations, converged, p)) {
    return KltEnd::kDiverged;
  }
  found = from_level({p.x - t.offset_x, p.y - t.offset_y}, level);
  return KltEnd::kFound;
}

// From the found position back to the previous image: it must end where the feature came from.
HWY_INLINE KltEnd check_backward(const Images& images, Point old, Point found, Template& t) {
  const TrackerConfig& config = images.config;
  const Place at = quantise(found.x, found.y);
  if (!fits(images.current.level[0], at)) return KltEnd::kBorder;
  build_template(images.current.level[0], at, found.x, found.y, t);
  Point back{old.x + t.offset_x, old.y + t.offset_y};
  if (!refine(images.previous.level[0], t, config.max_step_px, config.backward_iterations, config.coarse_step_px,
              back)) {
    return KltEnd::kBackward;
  }
  const float dx = back.x - t.offset_x - old.x, dy = back.y - t.offset_y - old.y;
  return dx * dx + dy * dy <= config.max_backward_px * config.max_backward_px ? KltEnd::kFound : KltEnd::kBackward;
}

HWY_INLINE KltEnd track_from(const Images& images, int start_level, KltTrack& track, Template& t) {
  const Point old{track.x, track.y};
  Point found{track.found_x, track.found_y};
  for (int level = start_level; level > 0; --level) track_level(images, level, old, t, found);
  const KltEnd end = track_level(images, 0, old, t, found);
  if (end != KltEnd::kFound) return end;
  const Place at = quantise(found.x + t.offset_x, found.y + t.offset_y);
  if (!fits(images.current.level[0], at)) return KltEnd::kBorder;
  track.correlation = correlate(images.current.level[0], at, t);
  if (!(track.correlation >= images.config.min_correlation)) return KltEnd::kCorrelation;
  const KltEnd back = check_backward(images, old, found, t);
  if (back != KltEnd::kFound) return back;
  track.found_x = found.x;
  track.found_y = found.y;
  return KltEnd::kFound;
}

HWY_INLINE bool usable(float x, float y) {
  constexpr float kFar = 1e5f;  // px; not a number fails as well
  return std::abs(x) < kFar && std::abs(y) < kFar;
}

void track_all(const TrackerConfig& config, const PyramidView& previous, const PyramidView& current, KltTrack* tracks,
               int count) {
  const Images images{config, previous, current};
  const int coarsest = current.levels - 1;
  Template scratch;
  for (int i = 0; i < count; ++i) {
    KltTrack& track = tracks[i];
    track.end = KltEnd::kBorder;
    if (!usable(track.x, track.y) || !usable(track.found_x, track.found_y)) continue;
    const int start = std::min(track.start_level, coarsest);
    track.end = track_from(images, start, track, scratch);
    const bool hopeless = track.end == KltEnd::kBorder || track.end == KltEnd::kFlat;
    if (track.end != KltEnd::kFound && !hopeless && start < coarsest) {
      track.end = track_from(images, coarsest, track, scratch);
    }
  }
}

}  // namespace epiline::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace epiline {
HWY_EXPORT(track_all);

void track_klt(const TrackerConfig& config, const PyramidView& previous, const PyramidView& current, KltTrack* tracks,
               int count) noexcept {
  HWY_DYNAMIC_DISPATCH(track_all)(config, previous, current, tracks, count);
}

}  // namespace epiline
#endif
