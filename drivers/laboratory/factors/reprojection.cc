#include "drivers/laboratory/factors/reprojection.h"

#include <Eigen/Eigenvalues>
#include <algorithm>

#include "estimator/factors/calibration.h"
#include "estimator/factors/lanes.h"

namespace epiline {

namespace {
// VINS-Mono's figures.
constexpr double kSigmaPx = 1.5;
constexpr double kNearestTriangulated = 0.1, kDistanceUnknown = 5;  // m
constexpr double kDepthDamping = 0.04;                              // 1/(1/m)^2, of a step of an inverse depth

struct Candidate {
  std::int16_t track;
  std::int8_t host, last;
};
}  // namespace

struct ReprojectionFactor::Memory {
  Landmark landmark[kMaxTracks], before[kMaxTracks];
  double saved[kMaxTracks];
  TrackBatch batch[kLandmarkBatches];
  BatchViews views;
  std::int16_t track_of[kLandmarkBatches][kBatchLanes];
  alignas(64) double rho[kLandmarkBatches][kBatchLanes], change[kLandmarkBatches][kBatchLanes];
  LandmarkScratch scratch;
  FrameGeometry frame[kMaxFrames];
  ExposedFrame exposed[kMaxFrames];
  Candidate candidate[kMaxTracks];
};

ReprojectionFactor::ReprojectionFactor(InstructionSet set)
    : memory_(new Memory), common_(factor_kernels(set)), kernels_(laboratory_kernels(set)) {}
ReprojectionFactor::~ReprojectionFactor() = default;

Landmark& ReprojectionFactor::landmark(int i) { return memory_->landmark[i]; }

namespace {

/// The next frame from k on (up to `frames`) whose view counts for the landmark; `frames`: none.
int next_view(const Window& w, const TrackRecord& t, const Landmark& l, int k, int frames) {
  while (k < frames && !(w.seen(t, k) && w.at(k).id >= l.since)) ++k;
  return k;
}

/// Linear triangulation from all views of `frames` frames, relative to the first; as inverse distance along its
/// bearing.
double triangulate(const Window& w, const TrackRecord& t, const Landmark& l, int host, const ExposedFrame* exposed) {
  const double scale = chart_of(w.view(t, host)).norm();
  Eigen::Matrix4d A = Eigen::Matrix4d::Zero();
  for (int k = host; k < w.size(); k = next_view(w, t, l, k + 1, w.size())) {
    Eigen::Matrix<double, 2, 4> rows;
    rows.leftCols<3>() = chart_of(w.view(t, k)) / scale * exposed[k].R_WC.transpose();
    rows.col(3) = rows.leftCols<3>().lazyProduct(exposed[host].c - exposed[k].c);
    A.noalias() += rows.transpose().lazyProduct(rows);
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> solver(A);
  const Eigen::Vector4d X = solver.eigenvectors().col(0);
  const double distance = (exposed[host].R_WC * bearing_of(w.view(t, host))).dot(X.head<3>()) / X[3];
  return distance > kNearestTriangulated ? 1 / distance : 1 / kDistanceUnknown;
}

}  // namespace

/// Brings the landmarks into the order of the window's tracks. A landmark found behind its host's camera is given up,
/// with all its track has shown so far.
void ReprojectionFactor::follow_tracks(const Window& w) {
  std::copy(memory_->landmark, memory_->landmark + count_, memory_->before);
  const int before = count_;
  count_ = w.track_count();
  for (int i = 0; i < count_; ++i) memory_->landmark[i] = Landmark{.track = w.track(i).id};
  for (int j = 0; j < before; ++j) {
    const int i = w.find(memory_->before[j].track);
    if (i < 0) continue;
    Landmark& l = memory_->landmark[i] = memory_->before[j];
    if (l.host != 0 && !(l.inverse_distance > 0)) l = {.track = l.track, .since = w.newest().id};
  }
}

void ReprojectionFactor::collect(const Window& w, const VisualSettings& s) noexcept {
  settings_ = s;
  const int n = w.size();
  follow_tracks(w);
  for (int k = 0; k < n; ++k) memory_->exposed[k] = exposed_frame(w, k);
  pack(w, n, std::max(1, w.capacity() - 3));
}

/// Packs the landmarks with a second view among the first `frames` and a host before frame `host_limit`. Every batch
/// has one host.
void ReprojectionFactor::pack(const Window& w, int frames, int host_limit) {
  Memory& m = *memory_;
  used_ = 0;
  for (int i = 0; i < count_; ++i) {
    const TrackRecord& t = w.track(i);
    if (!t.in_use) continue;
    Landmark& l = m.landmark[i];
    const int host = next_view(w, t, l, 0, frames);
    int last = host;
    for (int k = host; k < frames; k = next_view(w, t, l, k + 1, frames)) last = k;
    if (host >= host_limit || last == host) continue;
    if (l.host != w.at(host).id) {
      l.host = w.at(host).id;
      l.inverse_distance = triangulate(w, t, l, host, m.exposed);
    }
    m.candidate[used_++] = {static_cast<std::int16_t>(i), static_cast<std::int8_t>(host),
                            static_cast<std::int8_t>(last)};
  }
  std::sort(m.candidate, m.candidate + used_, [](const Candidate& a, const Candidate& b) {
    return a.host != b.host ? a.host < b.host : a.last != b.last ? a.last < b.last : a.track < b.track;
  });
  batches_ = 0;
  for (int begin = 0; begin < used_;) {
    int end = begin;
    while (end < used_ && end < begin + kBatchLanes && m.candidate[end].host == m.candidate[begin].host) ++end;
    TrackBatch& batch = m.batch[batches_];
    batch.first = m.candidate[begin].host;
    batch.last = m.candidate[end - 1].last;
    std::fill_n(batch.views, kBatchLanes, 0.0);
    for (int k = batch.first; k <= batch.last; ++k) std::fill_n(m.views[k], kBatchLanes, &kNoView);
    for (int i = begin; i < end; ++i) {
      const int track = m.candidate[i].track, lane = i - begin;
      const TrackRecord& t = w.track(track);
      m.track_of[batches_][lane] = static_cast<std::int16_t>(track);
      for (int k = batch.first; k < frames; k = next_view(w, t, m.landmark[track], k + 1, frames)) {
        m.views[k][lane] = &w.view(t, k);
        batch.views[lane] += 1;
      }
    }
    common_.put_views(m.views, batch.first, batch.last, 1 / kSigmaPx, batch);
    std::fill(m.track_of[batches_] + (end - begin), m.track_of[batches_] + kBatchLanes, std::int16_t{-1});
    ++batches_;
    begin = end;
  }
}

void ReprojectionFactor::load_depths() {
  Memory& m = *memory_;
  for (int b = 0; b < batches_; ++b)
    for (int lane = 0; lane < kBatchLanes; ++lane) {
      const int track = m.track_of[b][lane];
      m.rho[b][lane] = track >= 0 ? m.landmark[track].inverse_distance : 0;
    }
}

void ReprojectionFactor::run(const Window& w, int frames, VisualSystem& out) {
  Memory& m = *memory_;
  fill_geometry(w, frames, w.newest().x.p, m.frame);
  load_depths();
  kernels_.landmarks(m.batch, m.rho, batches_, m.frame, frames, kDepthDamping, m.scratch, out);
  move_to_bodies(m.frame, frames, out);
  add_calibration(w, frames, settings_.extrinsics, false, common_, out);
}

void ReprojectionFactor::linearise(const Window& w, VisualSystem& out) noexcept {
  for (int k = 0; k < w.size(); ++k) memory_->exposed[k] = exposed_frame(w, k);
  run(w, w.size(), out);
}

double ReprojectionFactor::cost(const Window& w) noexcept {
  Memory& m = *memory_;
  fill_geometry(w, w.size(), w.newest().x.p, m.frame);
  load_depths();
  return kernels_.landmark_cost(m.batch, m.rho, batches_, m.frame);
}

void ReprojectionFactor::save() noexcept {
  for (int i = 0; i < count_; ++i) memory_->saved[i] = memory_->landmark[i].inverse_distance;
}

void ReprojectionFactor::restore() noexcept {
  for (int i = 0; i < count_; ++i) memory_->landmark[i].inverse_distance = memory_->saved[i];
}

/// The depths' rows of the joint step, given what it did to the cameras (calibration included).
void ReprojectionFactor::step(const Window& moved) noexcept {
  Memory& m = *memory_;
  double motion[kMaxFrames][6];
  for (int k = 0; k < moved.size(); ++k) {
    const ExposedFrame now = exposed_frame(moved, k);
    Eigen::Map<Vec6> d(motion[k]);
    d << now.c - m.exposed[k].c, so3_log(now.R_WC * m.exposed[k].R_WC.transpose());
  }
  kernels_.landmark_step(m.batch, m.rho, batches_, m.frame, motion, m.scratch, m.change);
  for (int b = 0; b < batches_; ++b)
    for (int lane = 0; lane < kBatchLanes; ++lane)
      if (m.track_of[b][lane] >= 0) m.landmark[m.track_of[b][lane]].inverse_distance += m.change[b][lane];
}

void ReprojectionFactor::marginalise_oldest(const Window& w, const VisualSettings& s, VisualSystem& out) noexcept {
  settings_ = s;
  for (int k = 0; k < w.size(); ++k) memory_->exposed[k] = exposed_frame(w, k);
  pack(w, w.size(), 1);
  run(w, w.size(), out);
  for (int i = 0; i < count_; ++i)
    if (memory_->landmark[i].host == w.at(0).id) shift_host(w, i);
}

/// The landmark of frame 0 goes to the next frame that sees it, as far along its bearing as it is now.
void ReprojectionFactor::shift_host(const Window& w, int i) {
  Landmark& l = memory_->landmark[i];
  const TrackRecord& t = w.track(i);
  const int next = next_view(w, t, l, 1, w.size());
  if (!(l.inverse_distance > 0)) return;  // failed: the next collect() gives it up
  if (next == w.size()) {
    l.host = 0;
    return;
  }
  const ExposedFrame &from = memory_->exposed[0], &to = memory_->exposed[next];
  const Vec3 X = from.c + from.R_WC * bearing_of(w.view(t, 0)) / l.inverse_distance;
  const double distance = (to.R_WC * bearing_of(w.view(t, next))).dot(X - to.c);
  l.host = w.at(next).id;
  l.inverse_distance = 1 / (distance > 0 ? distance : kDistanceUnknown);
}

}  // namespace epiline
