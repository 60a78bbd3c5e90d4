#include "pipeline/vision/klt.h"

#include <algorithm>
#include <cmath>

#include "pipeline/vision/simd.h"
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "pipeline/vision/klt.cc"
#include <hwy/cache_control.h>
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

// One feature on its way through the levels.
struct Search {
  KltTrack* track;
  int start_level;
  Point old, found;  // px of level 0
  KltEnd end;
  // At one level.
  Template* patch;
  Point centre;  // px of the level, of the quantised template
  Move last;
  float last_length2, gain;
  bool diverged;

  HWY_INLINE void begin(Template& t, Point from) {
    patch = &t;
    centre = {from.x + t.offset_x, from.y + t.offset_y};
    last = {0.f, 0.f};
    last_length2 = 1e9f;
    gain = 1.f;
    diverged = false;
  }
  HWY_INLINE Point result() const { return {centre.x - patch->offset_x, centre.y - patch->offset_y}; }
};

// Searches that take their steps in turn. A step ends in a chain of dependent operations; the processor works on the
// next search meanwhile. Templates and patches of so many fit into the first cache.
constexpr int kBatch = 8;

struct Batch {
  Search* at[kBatch];
  int size = 0;
  HWY_INLINE void add(Search& s) { at[size++] = &s; }
};

// The template does not contain the contrast of the new image, so a step is wrong by that factor. Comparing a step
// with the previous one gives the factor (a secant along the step).
HWY_INLINE float secant_gain(float gain, Move step, Move last) {
  const float length2 = last.x * last.x + last.y * last.y;
  constexpr float kTooShort = 0.05f;  // px: below it the ratio is noise
  if (length2 <= kTooShort * kTooShort) return gain;
  return std::clamp(gain * (1.f - (step.x * last.x + step.y * last.y) / length2), 0.5f, 2.f);
}

struct Limits {
  int iterations;
  float max_step, converged;  // px of the level
};

// One step. True: it was not the last one. Diverged: left the image, or the steps grow.
HWY_INLINE bool improve(const ImageView& image, const Limits& limits, Search& s) {
  const Place at = quantise(s.centre.x, s.centre.y);
  s.diverged = !fits(image, at);
  if (s.diverged) return false;
  const Move step = gauss_newton_step(image, at, *s.patch);
  const float length2 = step.x * step.x + step.y * step.y;
  s.diverged = !(length2 < limits.max_step * limits.max_step) || (length2 > 4.f * s.last_length2 && length2 > 0.25f);
  if (s.diverged) return false;
  s.gain = secant_gain(s.gain, step, s.last);
  s.centre = {at.cx + step.x / s.gain, at.cy + step.y / s.gain};
  s.last = step;
  s.last_length2 = length2;
  return !(length2 < limits.converged * limits.converged);
}

HWY_NOINLINE void refine(const ImageView& image, const Limits& limits, Batch batch) {
  for (int i = 0; i < limits.iterations && batch.size > 0; ++i) {
    int left = 0;
    for (int k = 0; k < batch.size; ++k) {
      Search* const s = batch.at[k];
      batch.at[left] = s;
      left += improve(image, limits, *s);
    }
    batch.size = left;
  }
}

// Makes the template of one level. Not found: the level cannot say anything.
HWY_INLINE KltEnd start_level(const Images& images, int level, Search& s, Template& t) {
  const Point centre = to_level(s.old, level);
  const Place at = quantise(centre.x, centre.y);
  if (!fits(images.previous.level[level], at)) return KltEnd::kBorder;
  const bool known = level == 0 && s.track->patch_known;
  if (!known) build_template(images.previous.level[level], at, centre.x, centre.y, t);
  if (level == 0) s.track->patch_known = true;
  if (!(t.eigenvalue >= images.config.min_eigenvalue)) return KltEnd::kFlat;
  s.begin(t, to_level(s.found, level));
  return KltEnd::kFound;
}

// One level forward: improves `found` of those that the level can improve.
HWY_INLINE void track_level(const Images& images, int level, const Batch& batch) {
  Template scratch[kBatch];
  Batch going;
  for (int k = 0; k < batch.size; ++k) {
    Search& s = *batch.at[k];
    if (s.start_level < level) continue;
    const KltEnd end = start_level(images, level, s, level > 0 ? scratch[k] : *s.track->patch);
    if (level == 0) s.end = end;
    if (end == KltEnd::kFound) going.add(s);
  }
  const TrackerConfig& config = images.config;
  const float converged = level == 0 ? config.step_px : config.coarse_step_px;
  refine(images.current.level[level], {config.iterations, config.max_step_px, converged}, going);
  for (int k = 0; k < going.size; ++k) {
    Search& s = *going.at[k];
    if (!s.diverged) s.found = from_level(s.result(), level);
    if (s.diverged && level == 0) s.end = KltEnd::kDiverged;
  }
}

// Does the found patch look like the template?
HWY_INLINE KltEnd check_forward(const Images& images, const Search& s) {
  const Template& t = *s.patch;
  const Place at = quantise(s.found.x + t.offset_x, s.found.y + t.offset_y);
  if (!fits(images.current.level[0], at)) return KltEnd::kBorder;
  s.track->correlation = correlate(images.current.level[0], at, t);
  return s.track->correlation >= images.config.min_correlation ? KltEnd::kFound : KltEnd::kCorrelation;
}

// From the found position back to the previous image: it must end where the feature came from. The template of the way
// back is that of the next image's search.
HWY_INLINE void check_backward(const Images& images, const Batch& batch) {
  const TrackerConfig& config = images.config;
  Batch going;
  for (int k = 0; k < batch.size; ++k) {
    Search& s = *batch.at[k];
    if (s.end != KltEnd::kFound) continue;
    s.end = check_forward(images, s);
    if (s.end != KltEnd::kFound) continue;
    const Place at = quantise(s.found.x, s.found.y);
    s.end = fits(images.current.level[0], at) ? KltEnd::kFound : KltEnd::kBorder;
    if (s.end != KltEnd::kFound) continue;
    s.track->patch_known = false;
    build_template(images.current.level[0], at, s.found.x, s.found.y, *s.patch);
    s.begin(*s.patch, s.old);
    going.add(s);
  }
  refine(images.previous.level[0], {config.backward_iterations, config.max_step_px, config.coarse_step_px}, going);
  for (int k = 0; k < going.size; ++k) {
    Search& s = *going.at[k];
    const Point back = s.result();
    const float dx = back.x - s.old.x, dy = back.y - s.old.y;
    const bool near = dx * dx + dy * dy <= config.max_backward_px * config.max_backward_px;
    if (s.diverged || !near) s.end = KltEnd::kBackward;
  }
}

HWY_NOINLINE void track_batch(const Images& images, const Batch& batch) {
  for (int level = images.current.levels - 1; level >= 0; --level) track_level(images, level, batch);
  check_backward(images, batch);
  for (int k = 0; k < batch.size; ++k) {
    const Search& s = *batch.at[k];
    s.track->end = s.end;
    if (s.end != KltEnd::kFound) continue;
    s.track->found_x = s.found.x;
    s.track->found_y = s.found.y;
  }
}

// Features in groups, each from its start level or all from the same one.
struct Queue {
  const Images& images;
  Search searches[kBatch];
  Batch batch;

  HWY_INLINE explicit Queue(const Images& i) : images(i) {}
  HWY_INLINE void add(KltTrack& track, int start) {
    Search& s = searches[batch.size];
    s.track = &track;
    s.start_level = start;
    s.old = {track.x, track.y};
    s.found = {track.found_x, track.found_y};
    batch.add(s);
    if (batch.size == kBatch) flush();
  }
  HWY_INLINE void flush() {
    track_batch(images, batch);
    batch.size = 0;
  }
};

HWY_INLINE bool usable(float x, float y) {
  constexpr float kFar = 1e5f;  // px; not a number fails as well
  return std::abs(x) < kFar && std::abs(y) < kFar;
}

HWY_INLINE void prefetch_patch(const ImageView& image, Point centre) {
  const Place at = quantise(centre.x, centre.y);
  if (!fits(image, at)) return;
  const std::uint8_t* p = image.row(at.y) + at.x;
  for (int i = 0; i <= kSide; ++i, p += image.stride) {
    hwy::Prefetch(p);
    hwy::Prefetch(p + kSide);
  }
}

// What a search reads of the time before this image is no longer in the caches: other work was done since, and the
// processor cannot guess the addresses.
HWY_INLINE void prefetch(const PyramidView& previous, const KltTrack& track) {
  if (!usable(track.x, track.y)) return;
  for (int level = std::min(1, previous.levels - 1); level >= 0; --level) {
    prefetch_patch(previous.level[level], to_level({track.x, track.y}, level));
  }
  if (!track.patch_known) return;
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(track.patch);
  for (std::size_t i = 0; i < sizeof(KltTemplate); i += 64) hwy::Prefetch(bytes + i);
}

void track_all(const TrackerConfig& config, const PyramidView& previous, const PyramidView& current, KltTrack* tracks,
               int count) {
  const Images images{config, previous, current};
  const int coarsest = current.levels - 1;
  Queue queue(images);
  for (int i = 0; i < count; ++i) {
    if (i + kBatch < count) prefetch(previous, tracks[i + kBatch]);
    KltTrack& track = tracks[i];
    track.end = KltEnd::kBorder;
    if (!usable(track.x, track.y) || !usable(track.found_x, track.found_y)) continue;
    queue.add(track, std::min(track.start_level, coarsest));
  }
  queue.flush();
  for (int i = 0; i < count; ++i) {
    const KltEnd end = tracks[i].end;
    const bool hopeless = end == KltEnd::kBorder || end == KltEnd::kFlat;
    if (end != KltEnd::kFound && !hopeless && tracks[i].start_level < coarsest) queue.add(tracks[i], coarsest);
  }
  queue.flush();
}

bool scan_all(const ImageView& image, float x, float y, const ImageView& other, ScanPlace* places, int count) {
  constexpr float kLeastEigenvalue = 1e-3f;  // (grey/px)^2: anything but a blank patch
  for (int i = 0; i < count; ++i) places[i].correlation = -1;
  const Place from = quantise(x, y);
  if (!fits(image, from)) return false;
  Template patch;
  build_template(image, from, x, y, patch);
  if (!(patch.eigenvalue >= kLeastEigenvalue)) return false;
  for (int i = 0; i < count; ++i) {
    const Place at = quantise(places[i].x + patch.offset_x, places[i].y + patch.offset_y);
    if (fits(other, at)) places[i].correlation = correlate_roughly(other, at, patch);
  }
  return true;
}

const char* target_name() { return hwy::TargetName(HWY_TARGET); }

}  // namespace epiline::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace epiline {
HWY_EXPORT(track_all);
HWY_EXPORT(scan_all);
HWY_EXPORT(target_name);

void track_klt(const TrackerConfig& config, const PyramidView& previous, const PyramidView& current, KltTrack* tracks,
               int count) noexcept {
  HWY_DYNAMIC_DISPATCH(track_all)(config, previous, current, tracks, count);
}

bool scan_places(const ImageView& image, float x, float y, const ImageView& other, ScanPlace* places,
                 int count) noexcept {
  return HWY_DYNAMIC_DISPATCH(scan_all)(image, x, y, other, places, count);
}

const char* simd_target() noexcept { return HWY_DYNAMIC_DISPATCH(target_name)(); }

}  // namespace epiline
#endif
