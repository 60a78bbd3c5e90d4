#include "pipeline/vision/tracker.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

#include "estimator/monitor/turn_between.h"
#include "pipeline/vision/detector.h"
#include "pipeline/vision/klt.h"
#include "pipeline/vision/mask.h"
#include "pipeline/vision/pyramid.h"
#include "pipeline/vision/track_table.h"
#include "pipeline/vision/two_point.h"

namespace epiline {
namespace {

constexpr int kMinImageSide = 64;  // px
constexpr double kGapIntervals = 1.5;
constexpr float kOnAnother_px = 3;
// What counts each KltEnd.
constexpr std::uint64_t TrackerStats::*kLostCounters[] = {nullptr,
                                                          &TrackerStats::lost_border,
                                                          &TrackerStats::lost_flat,
                                                          &TrackerStats::lost_diverged,
                                                          &TrackerStats::lost_correlation,
                                                          &TrackerStats::lost_backward};

void require(bool condition, const char* text) {
  if (!condition) throw std::invalid_argument(text);
}

void check(const Camera& camera, const TrackerConfig& c, const Mask* mask) {
  require(camera.width() >= kMinImageSide && camera.height() >= kMinImageSide, "camera smaller than 64x64 px");
  require(c.max_features >= 1 && c.max_features <= TrackTable::kCapacity, "max_features out of range");
  require(c.levels >= 1 && c.levels <= kMaxLevels, "levels out of range");
  require(c.iterations >= 1 && c.backward_iterations >= 1 && c.hypotheses >= 1, "iterations below 1");
  require(c.wide_span >= 2 && c.wide_span < TrackTable::kHistory, "wide_span out of range");
  require(c.border_px >= kCellMargin, "border_px below 4");
  require(c.cells_per_feature > 0, "cells_per_feature not positive");
  require(!mask || (mask->width() == camera.width() && mask->height() == camera.height()),
          "mask of another size than the camera's images");
}

}  // namespace

struct Tracker::Impl {
  Impl(const Camera& camera_, const TrackerConfig& config_, std::shared_ptr<const Mask> mask_)
      : camera(camera_),
        config(config_),
        mask(std::move(mask_)),
        pyramids{Pyramid(camera_.width(), camera_.height(), config_.levels),
                 Pyramid(camera_.width(), camera_.height(), config_.levels)},
        detector(camera_.width(), camera_.height(), config_, mask.get()),
        templates(static_cast<std::size_t>(config_.max_features)) {
    rotation.fill(Mat3::Identity());
  }

  bool usable(const Frame& image) const {
    return image.data && image.width == camera.width() && image.height == camera.height() &&
           image.stride >= image.width;
  }
  bool sees(float x, float y) const { return !mask || mask->sees(x, y); }

  const Pyramid& current() const { return pyramids[image_number % 2]; }
  const Pyramid& previous() const { return pyramids[(image_number + 1) % 2]; }

  Camera camera;
  TrackerConfig config;
  std::shared_ptr<const Mask> mask;
  TrackerStats stats;
  Pyramid pyramids[2];
  Detector detector;
  TrackTable tracks;
  std::vector<KltTemplate> templates;  // of level 0 of the last image, at the tracks' `patch`
  std::uint64_t image_number = 0;
  std::uint32_t next_id = 0;
  HostStamp stamp;
  double interval_s = 0;                            // to the previous image; 0: there is none, or time did not advance
  bool gap = false;                                 // the interval is longer than usual
  std::array<Mat3, TrackTable::kHistory> rotation;  // image n - 1 to n, at n % kHistory
  RowTurn rows, rows_before;                        // of this image and the one before

  // Scratch of one image.
  std::array<KltTrack, TrackTable::kCapacity> wanted{};
  TrackTable::Column<float> rotated_x{}, rotated_y{}, predicted_x{}, predicted_y{};
  TrackTable::Column<bool> alive{};
  BearingPairs pairs;
  std::array<bool, BearingPairs::kCapacity> inlier{};
  std::array<int, TrackTable::kCapacity> pair_track{};

  void forget() {
    tracks.size = 0;
    interval_s = 0;
    gap = false;
    stamp = {};
  }

  void start_image(const Frame& image, const Mat3& R_CC0, const RowTurn& turn) {
    ++image_number;
    rows_before = rows;
    rows = turn;
    const double before_s = interval_s;
    interval_s = tracks.size > 0 && image.stamp > stamp ? (image.stamp - stamp).seconds() : 0;
    gap = interval_s > kGapIntervals * before_s;
    if (gap && before_s > 0) ++stats.gaps;
    stamp = image.stamp;
    rotation[image_number % TrackTable::kHistory] = R_CC0.allFinite() ? R_CC0 : Mat3(Mat3::Identity());
    pyramids[image_number % 2].build({image.data, image.width, image.height, image.stride});
  }

  // The bearing of track i, of a rolling shutter as if its row had been exposed at the image's stamp.
  Vec3 at_stamp(int i, const RowTurn& turn) const {
    const Vec3& f = tracks.bearing[i];
    const double row_s = camera.row_s(static_cast<double>(tracks.y[i]));
    return row_s == 0 ? f : Vec3(turn.at(row_s) * f);
  }

  // Where a direction at the stamp is seen, in the row that is exposed when it is there.
  bool project_turned(const Vec3& f_C, Vec2& px) const {
    if (!camera.project(f_C, px)) return false;
    const double row_s = camera.row_s(px.y());
    return row_s == 0 || camera.project(rows.at(row_s).transpose() * f_C, px);
  }

  // Where rotation alone, and rotation with the last parallax, put every track.
  void predict() {
    const Mat3& R = rotation[image_number % TrackTable::kHistory];
    const float dt = static_cast<float>(interval_s);
    for (int i = 0; i < tracks.size; ++i) {
      KltTrack& w = wanted[i];
      w = {.x = tracks.x[i], .y = tracks.y[i], .patch = &templates[tracks.patch[i]], .patch_known = tracks.age[i] > 0};
      Vec2 px;
      const bool visible = project_turned(R * at_stamp(i, rows_before), px);
      rotated_x[i] = visible ? static_cast<float>(px.x()) : std::nanf("");
      rotated_y[i] = visible ? static_cast<float>(px.y()) : std::nanf("");
      w.found_x = predicted_x[i] = rotated_x[i] + tracks.parallax_x[i] * dt;
      w.found_y = predicted_y[i] = rotated_y[i] + tracks.parallax_y[i] * dt;
      if (tracks.age[i] > 0 && !gap) w.start_level = start_level_for(tracks.innovation[i], config);
    }
  }

  void update_track(int i) {
    const KltTrack& found = wanted[i];
    const float per_s = interval_s > 0 ? static_cast<float>(1 / interval_s) : 0.f;
    tracks.velocity_x[i] = (found.found_x - tracks.x[i]) * per_s;
    tracks.velocity_y[i] = (found.found_y - tracks.y[i]) * per_s;
    tracks.parallax_x[i] = (found.found_x - rotated_x[i]) * per_s;
    tracks.parallax_y[i] = (found.found_y - rotated_y[i]) * per_s;
    tracks.innovation[i] = std::hypot(found.found_x - predicted_x[i], found.found_y - predicted_y[i]);
    tracks.x[i] = found.found_x;
    tracks.y[i] = found.found_y;
    ++tracks.age[i];
  }

  void take_bearing(int i) {
    alive[i] = camera.bearing({tracks.x[i], tracks.y[i]}, tracks.bearing[i], tracks.pixel_jacobian[i]);
  }

  // Returns how many tracks are found. `again`: in the same image.
  int find(bool again) {
    predict();
    for (int i = 0; again && i < tracks.size; ++i) wanted[i].patch_known = false;
    track_klt(config, previous().view(), current().view(), wanted.data(), tracks.size);
    return static_cast<int>(std::count_if(wanted.begin(), wanted.begin() + tracks.size,
                                          [](const KltTrack& w) { return w.end == KltEnd::kFound; }));
  }

  // Tracks that stay although the camera turns speak of the vehicle, whether they are ended for it or not. Where most
  // stay, it does not turn as the gyroscope says.
  void watch_vehicle() {
    int telling = 0, staying = 0;
    for (int i = 0; i < tracks.size; ++i) {
      const bool known = wanted[i].end == KltEnd::kFound && !std::isnan(rotated_x[i]);
      const Vec2 turned(rotated_x[i] - tracks.x[i], rotated_y[i] - tracks.y[i]);
      const Vec2 moved(wanted[i].found_x - tracks.x[i], wanted[i].found_y - tracks.y[i]);
      const bool tells = known && OwnParts::tells(turned);
      tracks.turned[i] = tells ? turned : Vec2(Vec2::Zero());
      alive[i] = tells && OwnParts::stays(moved);
      telling += tells;
      staying += alive[i];
    }
    for (int i = 0; i < tracks.size; ++i) {
      if (2 * staying > telling) tracks.turned[i].setZero();
      if (!alive[i] || tracks.turned[i].isZero()) continue;
      detector.watch(tracks.x[i], tracks.y[i], tracks.turned[i], true);
      tracks.turned[i].setZero();
    }
  }

  // Those that are left move as the others do: they speak of the world.
  void watch_world() {
    for (int i = 0; i < tracks.size; ++i)
      if (!tracks.turned[i].isZero()) detector.watch(tracks.x[i], tracks.y[i], tracks.turned[i], false);
    stats.own_cells = detector.own_cells();
  }

  // A gyroscope that was hit tells of a turn that never was: where that loses most of the tracks, none is the better
  // guess.
  void search() {
    Mat3& R = rotation[image_number % TrackTable::kHistory];
    if (2 * find(false) < tracks.size && !R.isIdentity()) {
      const Mat3 given = std::exchange(R, Mat3::Identity());
      if (2 * find(true) < tracks.size) {
        R = given;
        find(true);
      }
    }
    stats.tried += static_cast<std::uint64_t>(tracks.size);
    watch_vehicle();
    for (int i = 0; i < tracks.size; ++i) {
      KltEnd& end = wanted[i].end;
      alive[i] = end == KltEnd::kFound;
      if (alive[i]) {
        update_track(i);
        take_bearing(i);
        alive[i] = alive[i] && sees(tracks.x[i], tracks.y[i]);
        if (!alive[i]) end = KltEnd::kBorder;
      }
      if (const auto counter = kLostCounters[static_cast<std::size_t>(end)]) ++(stats.*counter);
    }
    tracks.keep(alive);
  }

  // Which of the tracks that are old enough agree with their bearings `span` images ago, turned by R. Returns how many.
  int agree(int span, const Mat3& R, float limit_px) {
    const Eigen::Matrix3f Rf = R.cast<float>();
    const std::size_t slot = (image_number - static_cast<std::uint64_t>(span)) % TrackTable::kHistory;
    pairs.size = 0;
    for (int i = 0; i < tracks.size; ++i) {
      if (tracks.age[i] < static_cast<std::uint32_t>(span)) continue;
      const int n = pairs.size++;
      pair_track[n] = i;
      const auto& old = tracks.history[i][slot];
      const Eigen::Vector3f before = Rf * Eigen::Vector3f(old[0], old[1], old[2]);
      const Eigen::Vector3f now = at_stamp(i, rows).cast<float>();
      pairs.before_x[n] = before.x(), pairs.before_y[n] = before.y(), pairs.before_z[n] = before.z();
      pairs.now_x[n] = now.x(), pairs.now_y[n] = now.y(), pairs.now_z[n] = now.z();
    }
    const float limit_rad = limit_px / static_cast<float>(camera.focal_px());
    find_inliers(pairs, {config.hypotheses, limit_rad, config.doubt_share}, inlier);
    return static_cast<int>(std::count(inlier.begin(), inlier.begin() + pairs.size, true));
  }

  // The turn since the last image that brings its bearings closest to those of now.
  Mat3 turn_seen() const {
    const std::size_t slot = (image_number - 1) % TrackTable::kHistory;
    Mat3 sum = Mat3::Zero();
    for (int i = 0; i < tracks.size; ++i) {
      const auto& old = tracks.history[i][slot];
      if (tracks.age[i] > 0) sum += at_stamp(i, rows) * Vec3(old[0], old[1], old[2]).transpose();
    }
    return rotation_from(sum);
  }

  // Ends the tracks that disagree with the others. Where most do since the last image, the turn given was wrong.
  void reject(int span, float limit_px, std::uint64_t& rejected) {
    if (image_number <= static_cast<std::uint64_t>(span)) return;
    Mat3 R = Mat3::Identity();
    for (int k = span - 1; k >= 0; --k) R = rotation[(image_number - k) % TrackTable::kHistory] * R;
    const int agreeing = agree(span, R, limit_px);
    if (span == 1 && 2 * agreeing < pairs.size) {
      const Mat3 seen = turn_seen();
      if (agree(span, seen, limit_px) > agreeing)
        rotation[image_number % TrackTable::kHistory] = seen;
      else
        agree(span, R, limit_px);
    }
    std::fill(alive.begin(), alive.begin() + tracks.size, true);
    for (int n = 0; n < pairs.size; ++n) {
      alive[pair_track[n]] = inlier[n];
      rejected += !inlier[n];
    }
    tracks.keep(alive);
  }

  void remember() {
    const std::size_t slot = image_number % TrackTable::kHistory;
    for (int i = 0; i < tracks.size; ++i) {
      const Vec3 f = at_stamp(i, rows);
      tracks.history[i][slot] = {static_cast<float>(f.x()), static_cast<float>(f.y()), static_cast<float>(f.z())};
    }
  }

  // A new track is expected to move as the nearest of those that were tracked, the first `tracked` ones: what lies
  // beside it is mostly as far away.
  void take_parallax(int i, int tracked) {
    float nearest2 = std::numeric_limits<float>::infinity();
    tracks.parallax_x[i] = tracks.parallax_y[i] = 0;
    for (int k = 0; k < tracked; ++k) {
      const float dx = tracks.x[k] - tracks.x[i], dy = tracks.y[k] - tracks.y[i], distance2 = dx * dx + dy * dy;
      if (!(distance2 < nearest2)) continue;
      nearest2 = distance2;
      tracks.parallax_x[i] = tracks.parallax_x[k];
      tracks.parallax_y[i] = tracks.parallax_y[k];
    }
  }

  // Ends tracks that lie where others do.
  void leave(std::span<const std::array<float, 2>> taken) {
    for (int i = 0; i < tracks.size; ++i)
      alive[i] = std::none_of(taken.begin(), taken.end(), [&](const std::array<float, 2>& other) {
        return std::hypot(tracks.x[i] - other[0], tracks.y[i] - other[1]) < kOnAnother_px;
      });
    tracks.keep(alive);
  }

  void detect(std::span<const std::array<float, 2>> taken, int most) {
    const int before = tracks.size;
    detector.detect(current().view().level[0], taken, most, tracks);
    for (int i = 0; i < tracks.size; ++i) {
      alive[i] = true;
      if (i < before) continue;
      tracks.age[i] = 0;
      tracks.velocity_x[i] = tracks.velocity_y[i] = 0;
      tracks.innovation[i] = 0;
      tracks.turned[i].setZero();
      take_parallax(i, before);
      take_bearing(i);
    }
    tracks.keep(alive);
    for (int i = before; i < tracks.size; ++i) tracks.id[i] = next_id++;
    stats.detected += static_cast<std::uint64_t>(tracks.size - before);
  }

  void publish(std::uint32_t first_id, FixedVector<TrackedFeature, kMaxFeatures>& out) const {
    for (int i = 0; i < tracks.size; ++i) {
      const Vec3& f = tracks.bearing[i];
      TrackedFeature feature;
      feature.id = track_id(first_id, tracks.id[i]);
      feature.age = tracks.age[i];
      feature.pixel = {tracks.x[i], tracks.y[i]};
      feature.row_s = static_cast<float>(camera.row_s(static_cast<double>(tracks.y[i])));
      feature.velocity_px_s = {tracks.velocity_x[i], tracks.velocity_y[i]};
      feature.bearing = {f.x(), f.y(), f.z()};
      Eigen::Map<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>>(feature.pixel_jacobian.data()) =
          tracks.pixel_jacobian[i];
      out.push_back(feature);
    }
  }
};

Tracker::Tracker(const Camera& camera, const TrackerConfig& config, std::size_t number) {
  check(camera, config, config.masks[number].get());
  impl_ = std::make_unique<Impl>(camera, config, config.masks[number]);
}

Tracker::~Tracker() = default;

void Tracker::step(const Frame& image, const Mat3& R_CC0, TrackedFrame& out, const RowTurn& rows) noexcept {
  out.stamp = image.stamp;
  out.sequence = image.sequence;
  out.features.clear();
  if (follow(image, R_CC0, rows)) fill({}, impl_->config.max_features, 0, out.features);
}

bool Tracker::follow(const Frame& image, const Mat3& R_CC0, const RowTurn& rows) noexcept {
  Impl& t = *impl_;
  ++t.stats.images;
  if (!t.usable(image)) {
    ++t.stats.images_refused;
    t.forget();
    return false;
  }
  t.start_image(image, R_CC0, rows);
  if (t.tracks.size > 0) {
    t.search();
    t.reject(1, t.config.near_limit_px, t.stats.rejected_near);
    t.reject(t.config.wide_span, t.config.wide_limit_px, t.stats.rejected_wide);
    t.watch_world();
    t.stats.tracked += static_cast<std::uint64_t>(t.tracks.size);
  }
  return true;
}

void Tracker::fill(std::span<const std::array<float, 2>> taken, int most, std::uint32_t first_id,
                   FixedVector<TrackedFeature, kMaxFeatures>& out) noexcept {
  Impl& t = *impl_;
  if (!taken.empty()) t.leave(taken);
  t.detect(taken, most);
  t.remember();
  t.publish(first_id, out);
}

bool Tracker::sees(float x, float y) const noexcept { return impl_->sees(x, y); }
const TrackerStats& Tracker::stats() const noexcept { return impl_->stats; }
const PyramidView& Tracker::pyramid() const noexcept { return impl_->current().view(); }
const PyramidView& Tracker::pyramid_before() const noexcept { return impl_->previous().view(); }

}  // namespace epiline
