#include "estimator/factors/track.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "estimator/factors/calibration.h"
#include "estimator/factors/lanes.h"

namespace epiline {

struct TrackFactor::Memory {
  TrackBatch batch[kMaxBatches];
  TrackScratch scratch;
  FrameGeometry frame[kMaxFrames];
  struct Candidate {
    std::int16_t track;
    std::int8_t first, last;
  } candidate[kMaxTracks];
  double ratio[kMaxTracks];
};

TrackFactor::TrackFactor(const Kernels& kernels) : kernels_(kernels), memory_(new Memory) {}
TrackFactor::~TrackFactor() = default;

namespace {
constexpr double kDepthDamping = 0.04;  // 1/(1/m)^2: a standard deviation of 5 1/m on the change of inverse depth

void fill_lane(const Window& w, const TrackRecord& t, int frames, double inverse_sigma, int lane, TrackBatch& batch) {
  int n = 0;
  for (int k = 0; k < frames; ++k) {
    if (!w.seen(t, k)) continue;
    put_view(w.view(t, k), inverse_sigma, k, lane, batch);
    ++n;
  }
  batch.views[lane] = n;
}
}  // namespace

/// Packs the tracks with at least two views among the first `frames`, those of `required_mask` only (0: all), sorted by
/// the frames they span so that a batch spans few more than its tracks do.
void TrackFactor::pack(const Window& w, const VisualSettings& s, std::uint32_t required_mask, int frames) {
  visual_ = s;
  const double inflation2 = s.sigma_inflation * s.sigma_inflation;
  settings_ = {kDepthDamping, s.cauchy * s.cauchy / inflation2, 1 / inflation2, 1 / inflation2, s.gate, s.inner_steps};
  int n = 0;
  for (int i = 0; i < w.track_count(); ++i) {
    const TrackRecord& t = w.track(i);
    if (!t.in_use || (required_mask && !(t.mask & required_mask))) continue;
    int first = -1, last = -1;
    for (int k = 0; k < frames; ++k)
      if (w.seen(t, k)) {
        if (first < 0) first = k;
        last = k;
      }
    if (last > first)
      memory_->candidate[n++] = {static_cast<std::int16_t>(i), static_cast<std::int8_t>(first),
                                 static_cast<std::int8_t>(last)};
  }
  std::sort(memory_->candidate, memory_->candidate + n, [](const auto& a, const auto& b) {
    return a.first != b.first ? a.first < b.first : a.last != b.last ? a.last < b.last : a.track < b.track;
  });
  batches_ = (n + kBatchLanes - 1) / kBatchLanes;
  const double inverse_sigma = 1 / (s.pixel_sigma * s.sigma_inflation);
  for (int b = 0; b < batches_; ++b) {
    TrackBatch& batch = memory_->batch[b];
    const int begin = b * kBatchLanes, end = std::min(n, begin + kBatchLanes);
    int last = 0;
    for (int i = begin; i < end; ++i) last = std::max<int>(last, memory_->candidate[i].last);
    clear(batch, memory_->candidate[begin].first, last);
    for (int i = begin; i < end; ++i)
      fill_lane(w, w.track(memory_->candidate[i].track), frames, inverse_sigma, i - begin, batch);
  }
}

void TrackFactor::collect(const Window& w, const VisualSettings& s) noexcept {
  pack(w, s, 0, w.size());
  gate_suspended_ = false;
}

void TrackFactor::run(const Window& w, int frames, bool marginal, VisualSystem& out) {
  fill_geometry(w, frames, memory_->frame);
  kernels_.track(memory_->batch, batches_, memory_->frame, frames, settings_, marginal, memory_->scratch, out);
  add_calibration(w, frames, visual_.extrinsics, out);
}

void TrackFactor::linearise(const Window& w, VisualSystem& out) noexcept {
  run(w, w.size(), false, out);
  if (settings_.gate && out.gated > visual_.gate_cap * out.tracks) {
    // So many at once are not outliers: the stamps, the calibration or the state are off, and dropping them would hide
    // it.
    settings_.gate = false;
    gate_suspended_ = true;
    const int gated = out.gated;
    run(w, w.size(), false, out);
    out.gated = gated;
  }
}

void TrackFactor::marginalise_oldest(const Window& w, const VisualSettings& s, VisualSystem& out) noexcept {
  const int frames = w.size() - 1;
  VisualSettings own = s;
  own.gate = settings_.gate;  // as decided for this frame
  const VisualSettings keep = visual_;
  pack(w, own, w.bit(0), frames);
  run(w, frames, true, out);
  visual_ = keep;
}

double TrackFactor::residual_sigma_px() noexcept {
  int n = 0;
  for (int b = 0; b < batches_; ++b)
    for (int lane = 0; lane < kBatchLanes; ++lane) {
      const double views = memory_->batch[b].views[lane];
      if (views < 3 || memory_->scratch.accepted[b][lane] == 0) continue;
      const double dof = 2 * views - 3, median = 1 - 2 / (9 * dof);  // Wilson-Hilferty: median of chi2/dof
      memory_->ratio[n++] = memory_->scratch.chi2[b][lane] / (dof * median * median * median);
    }
  if (n < 20) return 0;
  std::nth_element(memory_->ratio, memory_->ratio + n / 2, memory_->ratio + n);
  return std::sqrt(memory_->ratio[n / 2]) * visual_.pixel_sigma * visual_.sigma_inflation;
}

void clear(VisualSystem& s, int frames) {
  for (int k = 0; k < frames; ++k) {
    for (int l = k; l < frames; ++l) std::memset(s.H[k][l], 0, sizeof s.H[k][l]);
    std::memset(s.b[k], 0, sizeof s.b[k]);
    std::memset(s.H_ck[k], 0, sizeof s.H_ck[k]);
  }
  std::memset(s.H_cc, 0, sizeof s.H_cc);
  std::memset(s.b_c, 0, sizeof s.b_c);
  s.cost = 0;
  s.residuals = s.tracks = s.gated = 0;
}

}  // namespace epiline
