#include "estimator/parts/heights.h"

#include <algorithm>
#include <cmath>

#include "estimator/factors/beam.h"
#include "estimator/factors/height.h"

namespace epiline {

namespace {
constexpr double kJump = 5;            // sigmas: a difference of two offsets beyond is a jump, not noise and walk
constexpr double kLeastDown = 0.8;     // of a beam's unit vector: within 37 degrees of the vertical
constexpr double kStepMemory_m = 200;  // of way: after a step of the ground more may come
constexpr std::size_t index_of(HeightKind kind) { return static_cast<std::size_t>(kind); }
}  // namespace

bool Heights::add(const HeightSample& sample) {
  const std::size_t i = index_of(sample.kind);
  const HeightModel& model = common_.config.heights[i];
  const bool is_possible =
      sample.metres >= model.limits_m[0] && sample.metres <= model.limits_m[1];  // false for what is no number
  const bool taken = model.use && is_possible && readings_[i].push(sample.stamp, sample.metres);
  ++(taken ? common_.stats.height_samples : common_.stats.height_refused)[i];
  return taken;
}

void Heights::measure_path() {
  for (int k = 0; k < common_.window.size(); ++k) {
    Slot& s = common_.window.at(k);
    if (s.path_m >= 0) continue;
    s.path_m = k == 0 ? 0 : common_.window.at(k - 1).path_m + (s.x.p - common_.window.at(k - 1).x.p).head<2>().norm();
  }
}

/// The series of the nearest older frame whose offset the frame's reading agrees with, so that a single wrong reading
/// does not end a series; a new one if there is none.
std::uint32_t Heights::series_of(HeightKind kind, int frame) const {
  const Slot& s = common_.window.at(frame);
  const HeightReading& reading = s.heights[index_of(kind)];
  const double sigma = common_.config.heights[index_of(kind)].sigma_m, offset = height_offset(reading, s.x);
  const double variance_v = common_.carried.P(8, 8);
  for (int k = frame - 1; k >= 0; --k) {
    const Slot& older = common_.window.at(k);
    const HeightReading& other = older.heights[index_of(kind)];
    if (!other.has) continue;
    const double dt_s = (s.time - older.time).seconds();
    const double variance =
        2 * sigma * sigma + std::abs(reading.walked_m2 - other.walked_m2) + variance_v * dt_s * dt_s;
    if (std::abs(offset - height_offset(other, older.x)) <= kJump * std::sqrt(variance)) return other.series;
  }
  return memory_.series[index_of(kind)] + 1;
}

void Heights::attach_beam_tracks(double pixel_sigma) {
  const HeightModel& range = common_.config.heights[index_of(HeightKind::kRangeFinder)];
  const double sigma_px = common_.config.sigma_inflation * pixel_sigma;
  BeamSettings settings{sigma_px / common_.config.extrinsics.focal_px, range.sigma_m, range.walk_per_root_m,
                        range.walk_per_root_m * std::sqrt(kGroundStretch_m)};
  if (common_.window.newest().path_m - memory_.ground_step_at_m < kStepMemory_m)
    settings.ground_m = std::max(settings.ground_m, memory_.ground_step_m);
  const auto& used = memory_.beam_tracks;
  choose_beam_tracks(common_.window, settings, {used.data(), std::min(memory_.beam_tracks_served, used.size())});
}

/// Where the ground has steps, what is below the beam need not be what the tracks beside it lie on.
void Heights::note_ground_step(int frame) {
  const auto offset = [&](int k) {
    return height_offset(common_.window.at(k).heights[index_of(HeightKind::kRangeFinder)], common_.window.at(k).x);
  };
  for (int k = frame - 1; k >= 0; --k) {
    if (!common_.window.at(k).heights[index_of(HeightKind::kRangeFinder)].has) continue;
    memory_.ground_step_m = std::abs(offset(frame) - offset(k));
    memory_.ground_step_at_m = common_.window.at(frame).path_m;
    return;
  }
}

void Heights::remember_oldest() {
  const BeamTracks& leaving = common_.window.at(0).beam;
  for (int i = 0; i < leaving.count; ++i)
    memory_.beam_tracks[memory_.beam_tracks_served++ % memory_.beam_tracks.size()] =
        leaving.ids[static_cast<std::size_t>(i)];
}

void Heights::attach(double pixel_sigma) {
  measure_path();
  for (const HeightKind kind : {HeightKind::kBarometer, HeightKind::kRangeFinder}) {
    const std::size_t i = index_of(kind);
    const HeightModel& model = common_.config.heights[i];
    for (int k = 0; k < common_.window.size(); ++k) {
      Slot& s = common_.window.at(k);
      HeightReading& reading = s.heights[i];
      double metres = 0;
      if (reading.has || !readings_[i].at(s.time, metres)) continue;
      const bool is_beam = kind == HeightKind::kRangeFinder;
      if (is_beam && (s.x.R * model.beam_B).z() > -kLeastDown) continue;
      reading.metres = is_beam ? 0 : metres;
      reading.lever_B = model.p_BS + (is_beam ? metres : 0) * model.beam_B;
      reading.walked_m2 = model.walk_per_root_s * model.walk_per_root_s * 1e-9 * static_cast<double>(s.time.ns) +
                          model.walk_per_root_m * model.walk_per_root_m * s.path_m;
      reading.series = series_of(kind, k);
      reading.has = true;
      ++common_.stats.height_frames[i];
      if (reading.series <= memory_.series[i]) continue;
      if (memory_.series[i] > 0) ++common_.stats.height_jumps[i];
      if (is_beam) note_ground_step(k);
      memory_.series[i] = reading.series;
    }
  }
  attach_beam_tracks(pixel_sigma);
}

}  // namespace epiline
