#include "estimator/factors/track.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>

#include "estimator/factors/calibration.h"
#include "estimator/factors/lanes.h"

namespace epiline {

struct TrackFactor::Memory {
  TrackBatch batch[kMaxBatches];
  TrackVerdicts verdicts[kMaxBatches];
  TrackScratch scratch;
  NewsScratch news;
  FrameGeometry frame[kMaxPoses];
  Vec3 velocity_C[kMaxPoses];  ///< of the cameras, as collected, in the axes of the first one
  Vec3 grows_C[kMaxFrames];    ///< what of them grows with the way between the frames, and ...
  double way[kMaxFrames + 1];  ///< ... how long the way of so many frames was
  SortedTracks sorted;
  BatchViews views;
  Walks walks[2];
  double ratio[kMaxTracks];
  /// Where the points were found last, by the tracks' places in the window: what to iterate from, never what is known
  /// of them.
  struct Remembered {
    std::uint32_t id;
    bool valid = false;
    double point[4];
  } remembered[kMaxTracks];
  std::uint32_t id_of[kMaxBatches][kBatchLanes];
  std::uint16_t place_of[kMaxBatches][kBatchLanes];
};

TrackFactor::TrackFactor(InstructionSet set) : kernels_(factor_kernels(set)), memory_(new Memory) { restart(); }
TrackFactor::~TrackFactor() = default;

namespace {
/// Student's weight already reduces a drifting track with large steps, so the gate has nine times the limit of chi^2.
/// With it, 1 % of the tracks are gated (docs/derivations/drift.md).
constexpr double kDriftGate = 9;
constexpr double kClearDepth = 3;  // standard deviations of an inverse depth: the views show its sign
/// What a scene tells of the inverse depth of a track: most of it lies within 2/3 and twice its usual depth.
constexpr double kSceneSpread = 0.5;  ///< relative
constexpr double kUnseenScene = 0.1;  ///< 1/m, usual until ...
constexpr int kFewestOfScene = 20;    ///< ... so many tracks have shown theirs
constexpr double kStands_m = 1e-6;    // a way that short has no pace
/// What the error of a track is in the images of a second camera (docs/derivations/several_cameras.md), in steps.
constexpr double kSharedSteps = 0.65;  ///< correlation of the steps in both images
constexpr double kMatchVariance = 7;   ///< where the second camera finds the track it errs by 0.4 px: 7 of 0.15 px
constexpr double kShareAtAge = 10;     ///< images after the match at which the share is exact

/// Frames of one camera's views.
struct Run {
  int begin, end;
  int views() const { return end - begin + 1; }
};

/// The newest views that follow each other without a hole, because a drift is known from view to view.
Run newest_run(const SortedTracks::Spanned& of) {
  const auto beyond = static_cast<unsigned>(31 - of.last);
  return {of.last - std::countl_one(of.seen << beyond) + 1, of.last};
}

/// The same of the second camera, of frames with views of both cameras. Until the track is lost there and found anew.
Run newest_second_run(const Window& w, const TrackRecord& t, const Run& first) {
  const auto follows = [&](int k, int next) {
    return w.seen_by_second(t, k) && w.second_view(t, k).found == w.second_view(t, next).found;
  };
  int end = first.end;
  while (end >= first.begin && !follows(end, end)) --end;
  if (end < first.begin) return {0, -1};
  int begin = end;
  while (begin > first.begin && follows(begin - 1, begin)) --begin;
  return {begin, end};
}

/// Share of the first camera's error that is taken off the second one's. What was found late has all that the track had
/// drifted by until then.
double share_of(double found) { return (found + 1 + kSharedSteps * kShareAtAge) / (found + 1 + kShareAtAge); }

void set_walk(double start, double since, double step, int lane, Walks& walks) {
  walks.start[lane] = start;
  walks.since[lane] = since;
  walks.step[lane] = step;
}

/// The second camera's views are a chain of their own, given the first one's: so only frames with views of both count.
Run add_second_chain(const Window& w, const TrackRecord& t, const Run& first, int lane, TrackBatch& batch,
                     Walks& walks) {
  const Run run = newest_second_run(w, t, first);
  const double found = run.views() > 0 ? static_cast<double>(w.second_view(t, run.end).found) : 0;
  const double share = share_of(found), rest = 1 - share;
  batch.views[lane] += run.views();
  batch.shared[lane] = share;
  set_walk(kMatchVariance + rest * rest * (found + 1), found, 1 - 2 * kSharedSteps * share + share * share, lane,
           walks);
  return run;
}
}  // namespace

/// Takes over where the last linearisation left the points, before other tracks take their lanes.
void TrackFactor::remember_points() {
  for (int b = 0; b < batches_; ++b)
    for (int lane = 0; lane < kBatchLanes; ++lane) {
      const TrackBatch& batch = memory_->batch[b];
      if (batch.views[lane] < 2 || batch.warm[lane] == 0) continue;
      Memory::Remembered& r = memory_->remembered[memory_->place_of[b][lane]];
      r = {memory_->id_of[b][lane], true, {}};
      const double rho = batch.point[3][lane];
      for (int i = 0; i < 3; ++i) r.point[i] = batch.point[i][lane] + rho * origin_[i];
      r.point[3] = rho;
      r.valid = std::isfinite(r.point[0] + r.point[1] + r.point[2] + rho);
    }
}

void TrackFactor::recall_point(const TrackRecord& t, int b, int lane) {
  memory_->id_of[b][lane] = t.id;
  memory_->place_of[b][lane] = t.place;
  const Memory::Remembered& r = memory_->remembered[t.place];
  TrackBatch& batch = memory_->batch[b];
  const bool known = r.valid && r.id == t.id;
  batch.warm[lane] = known;
  if (!known) return;
  for (int i = 0; i < 3; ++i) batch.point[i][lane] = r.point[i] - r.point[3] * origin_[i];
  batch.point[3][lane] = r.point[3];
}

/// Median inverse depth of the tracks whose views show one, 1/m; as before where those are few.
double TrackFactor::scene() noexcept {
  int n = 0;
  for (int b = 0; b < batches_; ++b)
    for (int lane = 0; lane < kBatchLanes; ++lane) {
      const TrackVerdicts& verdicts = memory_->verdicts[b];
      const bool shows = verdicts.fits[lane] > 0 && verdicts.depth_sigmas[lane] > kClearDepth;
      if (shows) memory_->ratio[n++] = memory_->batch[b].point[3][lane];
    }
  if (n < kFewestOfScene) return scene_rho_;
  std::nth_element(memory_->ratio, memory_->ratio + n / 2, memory_->ratio + n);
  return memory_->ratio[n / 2];
}

void TrackFactor::restart() noexcept {
  batches_ = 0;
  scene_rho_ = kUnseenScene;
  memory_->sorted.forget();
  for (Memory::Remembered& r : memory_->remembered) r.valid = false;
}

/// Eight to a batch.
void TrackFactor::collect(const Window& w, const VisualSettings& s) noexcept {
  const bool drift = s.noise == TrackNoiseModel::kDrift;
  const double inflation = drift ? s.drift_inflation : s.sigma_inflation, inflation2 = inflation * inflation;
  sigma_ = (drift ? s.drift_sigma : s.pixel_sigma) * inflation;
  visual_ = s;
  const double unit = 1 / inflation2, gate_chi2 = drift ? kDriftGate * unit : unit;
  scene_rho_ = scene();
  const double spread = kSceneSpread * scene_rho_;
  settings_ = {scene_rho_,
               1 / (spread * spread),
               s.cauchy * s.cauchy * unit,
               gate_chi2,
               unit,
               s.gate,
               s.inner_steps,
               s.converged,
               drift,
               s.student,
               unit,
               s.rows,
               {s.lens, s.lens, false},
               0,
               0};
  gate_suspended_ = false;
  remember_points();
  origin_ = w.newest().x.p;
  slots_ = w.size() + 1;
  others_ = drift && w.rig.has_others();
  if (s.rows) hold_velocities(w);
  if (drift) place(w, w.size());
  SortedTracks& sorted = memory_->sorted;
  sorted.sort(w, others_);
  batches_ = sorted.batches();
  for (int b = 0; b < batches_; ++b) fill(w, b);
}

/// A batch, for the window as it is now.
void TrackFactor::fill(const Window& w, int b) {
  const SortedTracks& sorted = memory_->sorted;
  const auto [begin, end, first, last, camera, second_camera] = sorted.batch(b);
  TrackBatch& batch = memory_->batch[b];
  batch.first = first;
  batch.last = last;
  batch.home = camera * slots_;
  batch.second = batch.second_pose = 0;
  for (int i = begin; i < end && others_; ++i) {
    if (w.track(sorted.track(i)).second == 0) continue;
    batch.second = slots_;
    batch.second_pose = (second_camera - camera) * slots_;
  }
  BatchViews& views = memory_->views;
  for (int k = first; k <= last; ++k)
    for (const int slot : {k, batch.second + k}) std::fill_n(views[slot], kBatchLanes, &kNoView);
  for (int lane = 0; lane < kBatchLanes; ++lane) {
    batch.views[lane] = batch.warm[lane] = batch.shared[lane] = 0;
    for (Walks& walks : memory_->walks) set_walk(1, 0, 1, lane, walks);
  }
  for (int i = begin; i < end; ++i) {
    if (i + SortedTracks::kAhead < sorted.size()) fetch(w, w.track(sorted.track(i + SortedTracks::kAhead)));
    fill_lane(w, sorted.spanned(i), b, i - begin);
  }
  kernels_.put_views(views, first, last, 1 / sigma_, batch);
  if (batch.second > 0) kernels_.put_views(views, batch.second + first, batch.second + last, 1 / sigma_, batch);
  if (settings_.drift) kernels_.link_views(memory_->walks, memory_->frame, 1 / sigma_, batch);
}

void TrackFactor::fill_lane(const Window& w, const SortedTracks::Spanned& of, int b, int lane) {
  TrackBatch& batch = memory_->batch[b];
  BatchViews& views = memory_->views;
  const TrackRecord& t = w.track(of.track);
  const Run run = settings_.drift ? newest_run(of) : Run{of.first, of.last};
  for (int k = run.begin; k <= run.end; ++k)
    if (of.seen >> k & 1) views[k][lane] = &w.view(t, k);
  batch.views[lane] = settings_.drift ? run.views() : std::popcount(of.seen);
  if (batch.second > 0) {
    const Run second = add_second_chain(w, t, run, lane, batch, memory_->walks[1]);
    for (int k = second.begin; k <= second.end; ++k) views[batch.second + k][lane] = &w.second_view(t, k);
  }
  recall_point(t, b, lane);
}

void TrackFactor::fetch(const Window& w, const TrackRecord& t) const {
  w.fetch(t);
  __builtin_prefetch(&memory_->remembered[t.place]);
}

/// Where a camera is at another time than the stamp follows from its velocity. Until the next collect() it is held in
/// the first camera's axes, so that the cameras move with their body, and grows with the window's way, so that the
/// scale stays open (docs/derivations/rolling_shutter.md).
void TrackFactor::hold_velocities(const Window& w) {
  for (int k = 0; k < w.size(); ++k) {
    const ExposedFrame f = exposed_frame(w, k);
    const auto velocity_C = [&](const Vec3& lever_W) -> Vec3 {
      return f.R_WC.transpose() * (f.v + f.omega_W.cross(lever_W));
    };
    memory_->velocity_C[k] = velocity_C(f.c - f.p);
    memory_->grows_C[k] = f.R_WC.transpose() * f.v;
    memory_->way[k + 1] = way_m(w, k + 1);
    for (int c = 1; c < kMaxCameras && others_; ++c)
      memory_->velocity_C[c * slots_ + k] =
          velocity_C(f.c + f.R_WC * w.rig.poses[static_cast<std::size_t>(c)].p_CD - f.p);
  }
}

/// The first `frames` frames and the lens, as the window has them now.
void TrackFactor::place(const Window& w, int frames) {
  fill_geometry(w, frames, origin_, memory_->frame);
  if (others_) place_others(w, frames);
  held_m_ = visual_.rows && memory_->way[frames] > kStands_m ? memory_->way[frames] : 0;
  settings_.wants[kPace] = held_m_ > 0;
  const double pace = held_m_ > 0 ? way_m(w, frames) / held_m_ - 1 : 0;
  for (int k = 0; k < frames && visual_.rows; ++k) {
    const Mat3 R_WC = Eigen::Map<const RowMat3>(memory_->frame[k].R_WC);
    const Vec3 grows = R_WC * memory_->grows_C[k];
    for (int i = k; i < (others_ ? kMaxCameras * slots_ : slots_); i += slots_) {
      Eigen::Map<Vec3>(memory_->frame[i].v) = R_WC * memory_->velocity_C[i] + pace * grows;
      Eigen::Map<Vec3>(memory_->frame[i].grows) = grows;
    }
  }
  settings_.focal = w.calibration.focal;
  settings_.shape = w.calibration.shape;
}

/// The other cameras' poses follow from the first one's: the rig is rigid. Their motion is the same body's.
void TrackFactor::place_others(const Window& w, int frames) {
  for (int k = 0; k < frames; ++k) {
    const FrameGeometry& first = memory_->frame[k];
    const Mat3 R_WC = Eigen::Map<const RowMat3>(first.R_WC);
    for (int c = 1; c < kMaxCameras; ++c) {
      const RigPose& pose = w.rig.poses[static_cast<std::size_t>(c)];
      if (!w.rig.use[static_cast<std::size_t>(c)]) continue;
      FrameGeometry& other = memory_->frame[c * slots_ + k];
      Eigen::Map<RowMat3>(other.R_WC) = R_WC * pose.R_CD;
      Eigen::Map<Vec3>(other.c) = Eigen::Map<const Vec3>(first.c) + R_WC * pose.p_CD;
      std::memcpy(other.p, first.p, sizeof other.p);
    }
  }
}

void TrackFactor::run(const Window& w, VisualSystem& out) {
  place(w, w.size());
  kernels_.track(memory_->batch, batches_, memory_->frame, w.size(), settings_, memory_->scratch, memory_->verdicts,
                 out);
  add_calibration(w, w.size(), visual_.extrinsics, visual_.lens, kernels_, out, held_m_);
}

double TrackFactor::cost(const Window& w) noexcept {
  place(w, w.size());
  return kernels_.track_cost(memory_->batch, batches_, memory_->frame, w.size(), settings_, memory_->verdicts);
}

void TrackFactor::linearise(const Window& w, VisualSystem& out) noexcept {
  run(w, out);
  if (settings_.gate && out.gated > visual_.gate_cap * out.tracks) {
    // So many at once are not outliers: the stamps, the calibration or the state are off, and dropping them would hide
    // it.
    settings_.gate = false;
    gate_suspended_ = true;
    const int gated = out.gated;
    run(w, out);
    out.gated = gated;
  }
}

/// Of the window as it was collected: the batches that hold frame 0's tracks stand side by side.
void TrackFactor::marginalise_oldest(const Window& w, const VisualSettings& s, VisualSystem& out) noexcept {
  if (!memory_->sorted.is_of(w)) collect(w, s);
  const int frames = w.lasting();
  const int middle = memory_->sorted.batches_of_others();
  int begin = middle, end = middle;
  while (begin > 0 && memory_->batch[begin - 1].first == 0) --begin;
  while (end < batches_ && memory_->batch[end].first == 0) ++end;
  place(w, frames);
  kernels_.track_news(memory_->batch + begin, end - begin, memory_->frame, frames, settings_, memory_->news,
                      memory_->verdicts + begin, out);
  add_calibration(w, frames, visual_.extrinsics, visual_.lens, kernels_, out, held_m_);
}

namespace {
/// Median of chi^2 (Wilson-Hilferty) of a track's residuals, by its number of views.
constexpr auto kMedianOfViews = [] {
  std::array<double, kMaxSlots + 1> chi2{};
  for (std::size_t views = 3; views < chi2.size(); ++views) {
    const double dof = 2 * static_cast<double>(views) - 3, median = 1 - 2 / (9 * dof);
    chi2[views] = dof * median * median * median;
  }
  return chi2;
}();
}  // namespace

TrackFit TrackFactor::track_fit() noexcept {
  TrackFit fit;
  int n = 0, ahead[2] = {}, behind[2] = {};  // by whether they fit
  for (int b = 0; b < batches_; ++b)
    for (int lane = 0; lane < kBatchLanes; ++lane) {
      const TrackVerdicts& verdicts = memory_->verdicts[b];
      const double views = memory_->batch[b].views[lane], depth = verdicts.depth_sigmas[lane];
      if (views < 2) continue;
      ++fit.tracks;
      const bool fits = verdicts.fits[lane] > 0;
      fit.fits += fits ? 1 : 0;
      ahead[fits] += depth > kClearDepth ? 1 : 0;
      behind[fits] += depth < -kClearDepth ? 1 : 0;
      if (views < 3 || !fits) continue;
      memory_->ratio[n++] = verdicts.chi2[lane] / kMedianOfViews[static_cast<std::size_t>(views)];
    }
  // What does not fit may move by itself: where the others lie ahead it says nothing.
  const bool is_alone = ahead[1] <= behind[1];
  fit.ahead = ahead[1] + (is_alone ? ahead[0] : 0);
  fit.behind = behind[1] + (is_alone ? behind[0] : 0);
  if (n < 20) return fit;
  double* const ratio = memory_->ratio;
  std::nth_element(ratio, ratio + n / 2, ratio + n);
  std::nth_element(ratio, ratio + n / 4, ratio + n / 2);
  fit.median_px = std::sqrt(ratio[n / 2]) * sigma_;
  fit.quarter_px = std::sqrt(ratio[n / 4]) * sigma_;
  return fit;
}

}  // namespace epiline
