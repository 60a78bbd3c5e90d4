#include "drivers/laboratory/factors/epipolar.h"

#include "estimator/factors/calibration.h"
#include "estimator/factors/lanes.h"
#include "estimator/factors/sorted_tracks.h"

namespace epiline {

namespace {
constexpr double kPaperSigmaPx = 1.5;     // VINS-Mono's, kept by the paper
constexpr double kLeastAlongAxis = 0.05;  // f_z of a bearing: z has no meaning sideways and behind

double scale(const VisualSettings& s) { return s.focal_px / kPaperSigmaPx; }
}  // namespace

struct EpipolarFactor::Memory {
  SortedTracks sorted;
  EpipolarViews views;
  FrameGeometry frame[kMaxFrames];
};

EpipolarFactor::EpipolarFactor(InstructionSet set)
    : common_(factor_kernels(set)), kernels_(laboratory_kernels(set)), memory_(new Memory) {}
EpipolarFactor::~EpipolarFactor() = default;

void EpipolarFactor::restart() noexcept { memory_->sorted.forget(); }

void EpipolarFactor::put_track(const Window& w, const TrackRecord& t, int b, int lane) {
  EpipolarViews& views = memory_->views;
  int n = 0;
  for (int k = views.first[b]; k <= views.last[b]; ++k) {
    const Vec3 f_C = w.seen(t, k) ? bearing_of(w.view(t, k)) : Vec3(Vec3::Zero());
    const bool counts = f_C.z() > kLeastAlongAxis;
    const Vec3 z = counts ? Vec3(f_C / f_C.z()) : Vec3(Vec3::Zero());
    for (int i = 0; i < 3; ++i) views.z[k][b][i][lane] = z[i];
    n += counts;
  }
  tracks_ += n >= 2;
  pairs_ += n * (n - 1) / 2;
}

void EpipolarFactor::collect(const Window& w, const VisualSettings& s) noexcept {
  settings_ = s;
  tracks_ = pairs_ = 0;
  SortedTracks& sorted = memory_->sorted;
  EpipolarViews& views = memory_->views;
  sorted.sort(w);
  for (int b = 0; b < sorted.batches(); ++b) {
    const SortedTracks::Batch batch = sorted.batch(b);
    views.first[b] = batch.first;
    views.last[b] = batch.last;
    for (int i = batch.begin; i < batch.end; ++i) {
      if (i + SortedTracks::kAhead < sorted.size()) w.fetch(w.track(sorted.track(i + SortedTracks::kAhead)));
      put_track(w, w.track(sorted.track(i)), b, i - batch.begin);
    }
    for (int lane = batch.end - batch.begin; lane < kBatchLanes; ++lane) put_track(w, {}, b, lane);
  }
}

void EpipolarFactor::run(const Window& w, int frames, bool oldest_only, VisualSystem& out) {
  clear(out, frames);
  fill_geometry(w, frames, w.newest().x.p, memory_->frame);
  kernels_.epipolar(memory_->views, memory_->sorted.batches(), memory_->frame, frames, scale(settings_), oldest_only,
                    out);
  move_to_bodies(memory_->frame, frames, out);
  add_calibration(w, frames, settings_.extrinsics, false, common_, out);
}

void EpipolarFactor::linearise(const Window& w, VisualSystem& out) noexcept {
  run(w, w.size(), false, out);
  out.tracks = tracks_;
  out.residuals = pairs_;
}

double EpipolarFactor::cost(const Window& w) noexcept {
  fill_geometry(w, w.size(), w.newest().x.p, memory_->frame);
  return kernels_.epipolar_cost(memory_->views, memory_->sorted.batches(), memory_->frame, w.size(), scale(settings_));
}

void EpipolarFactor::marginalise_oldest(const Window& w, const VisualSettings& s, VisualSystem& out) noexcept {
  if (!memory_->sorted.is_of(w)) collect(w, s);
  run(w, w.lasting(), true, out);
}

}  // namespace epiline
