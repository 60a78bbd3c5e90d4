#include "pipeline/vision/second_tracker.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

#include "pipeline/vision/klt.h"
#include "pipeline/vision/track_table.h"
#include "pipeline/vision/tracker.h"

namespace epiline {
namespace {

constexpr double kLeastBaseline_m = 1e-3;
constexpr double kLeastSine = 1e-3;   // between bearing and baseline; below it the epipolar plane is undefined
constexpr double kMostScale = 1.5;    // ratio of the focal lengths
constexpr double kLeastCosine = 0.8;  // of the turn between the cameras' axes
constexpr int kScanLevel = 1;         // of the pyramid
constexpr double kScanStep = 1.5;     // px of that level
constexpr int kScanPlaces = 33, kExactEvery = 4;  // places on an epipolar line; of those, every 4th is projected
constexpr float kLeastScanned = 0.5f;             // correlation at that level
constexpr float kWorse = 0.15f;     // of correlation there, less than the best place's: a second place is not searched
constexpr float kMostFromPeak = 2;  // px of that level, between scanned and found place
constexpr float kSamePlace_px = 2, kAlike = 0.05f;  // distance and difference of correlation of two found places
constexpr float kLeastMatched = 0.8f;               // correlation of a first match
constexpr std::uint64_t kSparesEvery = 8;           // images
constexpr double kVelocityError_m_s = 0.3;          // of the rig's velocity, where cameras expose at different times
constexpr float kInnovationOfNewView_px = 1;        // the first search in the next image starts at level 1

// A track of the first camera, and its view in the last image of the second one.
struct Chain {
  std::uint32_t id = 0;
  bool matched = false;    // has a view; the following members up to `pixel_jacobian` belong to it
  bool confirmed = false;  // was found again in an image after the match: wrong matches rarely are
  float x = 0, y = 0;      // px
  float innovation = 0;    // px, between predicted and found position
  Vec3 bearing = Vec3::Zero();
  Mat23 pixel_jacobian = Mat23::Zero();
  double exposed_s = 0;     // after the stamp of the first camera's image
  double inverse_m = 0;     // 1 / distance from the first camera, of the last view
  int patch = 0;            // place of its KLT template, which is that of the view
  int spare = 0;            // place of another template
  std::uint32_t found = 0;  // age of the track at the match
  int failures = 0;         // searches since the last view
  int wait = 0;             // images to leave out before the next search
};

int pause_after(int failures) { return (1 << std::min(failures, 4)) - 1; }

}  // namespace

struct SecondTracker::Impl {
  Impl(const Camera& second, const SecondRig& rig, const TrackerConfig& config_, std::size_t number, bool matches_)
      : camera(second),
        R_SC(rig.R_SC),
        p_SC(rig.p_SC),
        config(config_),
        first_id(first_track_of(number)),
        matches(matches_),
        alone(second, config_, number),
        chains(static_cast<std::size_t>(config_.max_features)),
        templates(2 * chains.size()),
        scan_level(std::min(kScanLevel, config_.levels - 1)) {
    scan_step_per_m = kScanStep * (1 << scan_level) / (camera.focal_px() * p_SC.norm());
    for (std::size_t i = 0; i < chains.size(); ++i) {
      chains[i].patch = static_cast<int>(2 * i);
      chains[i].spare = chains[i].patch + 1;
    }
  }

  using Tracks = std::span<const TrackedFeature>;

  // x_S = R x_C + p: from the axes of the first camera at its stamp, seen from where it took a track, to those of the
  // second camera when it takes it.
  struct Relation {
    Mat3 R;
    Vec3 p;
  };
  double exposed_s(double y_px) const { return motion.second_later_s + camera.row_s(y_px); }

  float to_scan(double px) const { return static_cast<float>((px + 0.5) / (1 << scan_level) - 0.5); }
  float from_scan(float px) const { return (px + 0.5f) * static_cast<float>(1 << scan_level) - 0.5f; }

  const PyramidView& current() const { return alone.pyramid(); }
  const PyramidView& previous() const { return alone.pyramid_before(); }

  Camera camera;
  Mat3 R_SC;
  Vec3 p_SC;
  TrackerConfig config;
  std::uint32_t first_id;  // of the second camera's own tracks
  bool matches;            // the first camera's tracks are looked for
  bool sees = false;       // the last image can be used
  SecondStats stats;
  Tracker alone;              // tracks that the first camera does not see
  std::vector<Chain> chains;  // the first `size` belong to the tracks, in their order
  std::vector<KltTemplate> templates;
  int scan_level;
  double scan_step_per_m;
  int size = 0;
  RigMotion motion;    // of this image
  Relation of_stamps;  // relation_between() both images' stamps

  // Scratch of one image.
  static constexpr int kMostSearches = 2 * TrackTable::kCapacity;
  std::array<KltTrack, kMostSearches> wanted{};
  std::array<int, kMostSearches> chain_of{};
  std::array<float, kMostSearches> predicted_x{}, predicted_y{};
  std::array<ScanPlace, kScanPlaces> places{};
  std::array<std::array<float, 2>, TrackTable::kCapacity> taken{};
  int searches = 0;

  void forget_views() {
    for (int i = 0; i < size; ++i) chains[i].matched = false;
  }

  // Chains of tracks that live on keep their order; a new track takes the template of one that ended.
  void take_over(Tracks tracks) {
    const int count = static_cast<int>(std::min(tracks.size(), chains.size()));
    int kept = 0;
    for (int k = 0; k < size && kept < count; ++k)
      if (chains[k].id == tracks[kept].id) std::swap(chains[kept++], chains[k]);
    for (int i = kept; i < count; ++i) {
      const int patch = chains[i].patch, spare = chains[i].spare;
      chains[i] = {};
      chains[i].patch = patch;
      chains[i].spare = spare;
      chains[i].id = tracks[i].id;
    }
    size = count;
  }

  Relation relation(const TrackedFeature& feature, double exposed_s) const {
    if (feature.row_s == 0 && exposed_s == motion.second_later_s) return of_stamps;
    return relation_between(static_cast<double>(feature.row_s), exposed_s);
  }

  Relation relation_between(double first_s, double second_s) const {
    const Mat3 R = R_SC * motion.first.at(second_s).transpose();
    return {R, p_SC + (first_s - second_s) * (R * motion.velocity_C)};
  }

  // The bearing, of a rolling shutter as if its row had been exposed at the stamp.
  Vec3 at_stamp(const TrackedFeature& feature) const {
    const Vec3 f(feature.bearing.data());
    return feature.row_s == 0 ? f : Vec3(motion.first.at(static_cast<double>(feature.row_s)) * f);
  }

  // In the row that is exposed when it is there. Not a number where the second camera does not see the point.
  Vec2 seen_at(const TrackedFeature& feature, double inverse_m) const {
    const Vec3 f_C = at_stamp(feature);
    Vec2 px;
    const auto seen = [&](double at_s) {
      const Relation SC = relation(feature, at_s);
      return camera.project(SC.R * f_C + inverse_m * SC.p, px);
    };
    bool is_seen = seen(motion.second_later_s);
    if (is_seen && camera.row_s(px.y()) != 0) is_seen = seen(exposed_s(px.y()));
    return is_seen ? px : Vec2::Constant(std::numeric_limits<double>::quiet_NaN());
  }

  // Takes the position found if the point can be there: near the epipolar plane, and between infinity and a baseline
  // away.
  bool take(Chain& chain, const TrackedFeature& feature, const KltTrack& found) {
    Vec3 f_S;
    Mat23 J;
    if (!alone.sees(found.found_x, found.found_y)) return false;
    if (!camera.bearing({found.found_x, found.found_y}, f_S, J)) return false;
    const double at_s = exposed_s(static_cast<double>(found.found_y));
    const auto [R, p] = relation(feature, at_s);
    const double distance_m = p.norm();  // between both cameras when they took it
    const Vec3 infinity = R * at_stamp(feature);
    const Vec3 across = infinity.cross(p);
    if (!(distance_m > kLeastBaseline_m && across.norm() > kLeastSine * distance_m)) return false;
    const Vec3 normal = across.normalized();
    // In the triangle of both cameras and the point: angles from infinity to the view, and from the view to the
    // baseline.
    const double sine = normal.dot(infinity.cross(f_S)), rest = normal.dot(f_S.cross(p)) / distance_m;
    const double inverse_m = std::max(0., sine) / (rest * distance_m);
    const double across_px = (J * normal).norm(), off_plane_px = across_px * std::abs(normal.dot(f_S));
    const double apart_s = std::abs(at_s - static_cast<double>(feature.row_s));
    const double moved_px = sine < rest ? across_px * inverse_m * kVelocityError_m_s * apart_s : 0;
    if (!(off_plane_px <= kMostOffPlane_px + moved_px)) {
      ++stats.off_plane;
      return false;
    }
    const double beyond_px = -(J * normal.cross(f_S)).norm() * sine;
    if (beyond_px > kMostOffPlane_px || !(sine < rest)) {
      ++stats.wrong_side;
      return false;
    }
    chain.inverse_m = inverse_m;
    chain.x = found.found_x;
    chain.y = found.found_y;
    chain.bearing = f_S;
    chain.pixel_jacobian = J;
    chain.exposed_s = at_s;
    return true;
  }

  // From the second image before to this one. The first camera says how the direction has changed; the distance is that
  // of the image before.
  void follow(Tracks tracks) {
    int count = 0;
    for (int i = 0; i < size; ++i) {
      const Chain& chain = chains[i];
      if (!chain.matched) continue;
      const Vec2 px = seen_at(tracks[i], chain.inverse_m);
      predicted_x[count] = static_cast<float>(px.x());
      predicted_y[count] = static_cast<float>(px.y());
      chain_of[count] = i;
      wanted[count] = {.x = chain.x,
                       .y = chain.y,
                       .found_x = predicted_x[count],
                       .found_y = predicted_y[count],
                       .start_level = start_level_for(chain.innovation, config),
                       .patch = &templates[chain.patch],
                       .patch_known = true};
      ++count;
    }
    track_klt(config, previous(), current(), wanted.data(), count);
    for (int k = 0; k < count; ++k) {
      Chain& chain = chains[chain_of[k]];
      chain.matched = wanted[k].end == KltEnd::kFound && take(chain, tracks[chain_of[k]], wanted[k]);
      chain.innovation = std::hypot(wanted[k].found_x - predicted_x[k], wanted[k].found_y - predicted_y[k]);
      chain.confirmed = chain.matched;
      if (!chain.matched) chain.wait = 1;  // a new match is not the same view: at least one image lies between them
      stats.lost += !chain.matched;
    }
    stats.followed += static_cast<std::uint64_t>(count);
  }

  // Places in level `kScanLevel` of the second image, from infinity to near, along the epipolar line of the track.
  int places_of(const TrackedFeature& feature) {
    int count = 0;
    for (; count < kScanPlaces; count += kExactEvery) {
      const Vec2 px = seen_at(feature, count * scan_step_per_m);
      if (!px.allFinite()) break;
      ScanPlace& exact = places[count];
      exact = {to_scan(px.x()), to_scan(px.y())};
      if (count == 0) continue;
      const ScanPlace& before = places[count - kExactEvery];
      for (int k = 1; k < kExactEvery; ++k) {
        const float share = static_cast<float>(k) / kExactEvery;
        places[count - kExactEvery + k] = {before.x + share * (exact.x - before.x),
                                           before.y + share * (exact.y - before.y)};
      }
    }
    return count == 0 ? 0 : count - kExactEvery + 1;
  }

  // Whether place k of `count` looks more like the track than those beside it.
  bool is_peak(int k, int count) const {
    const float here = places[k].correlation;
    return here >= kLeastScanned && (k == 0 || here > places[k - 1].correlation) &&
           (k + 1 == count || here >= places[k + 1].correlation);
  }

  // The best place and the second best one; -1 where there is none.
  std::array<int, 2> best_places(int count) const {
    std::array<int, 2> best{-1, -1};
    for (int k = 0; k < count; ++k) {
      if (!is_peak(k, count)) continue;
      const auto beats = [&](int other) { return other < 0 || places[k].correlation > places[other].correlation; };
      if (beats(best[0])) {
        best[1] = std::exchange(best[0], k);
      } else if (beats(best[1])) {
        best[1] = k;
      }
    }
    if (best[1] >= 0 && places[best[1]].correlation < places[best[0]].correlation - kWorse) best[1] = -1;
    return best;
  }

  // Adds a search for track i that begins at `place`.
  void add_search(const TrackedFeature& feature, int i, const ScanPlace& place, int patch) {
    predicted_x[searches] = from_scan(place.x);
    predicted_y[searches] = from_scan(place.y);
    chain_of[searches] = i;
    wanted[searches] = {.x = feature.pixel[0],
                        .y = feature.pixel[1],
                        .found_x = predicted_x[searches],
                        .found_y = predicted_y[searches],
                        .start_level = scan_level,
                        .patch = &templates[patch]};
    ++searches;
  }

  // The two best places become searches of track i.
  void plan_match(const PyramidView& first, const TrackedFeature& feature, int i) {
    const int count = places_of(feature);
    if (!scan_places(first.level[scan_level], to_scan(feature.pixel[0]), to_scan(feature.pixel[1]),
                     current().level[scan_level], places.data(), count))
      return;
    const auto [best, second] = best_places(count);
    if (best >= 0) add_search(feature, i, places[best], chains[i].patch);
    if (second >= 0) add_search(feature, i, places[second], chains[i].spare);
  }

  // Whether search k ended near the place where it began.
  bool stayed(int k) const {
    const float most_px = kMostFromPeak * static_cast<float>(1 << scan_level);
    return wanted[k].end == KltEnd::kFound &&
           std::hypot(wanted[k].found_x - predicted_x[k], wanted[k].found_y - predicted_y[k]) <= most_px;
  }

  // The better one of the searches [k, end) of a track. -1: none, or two places look alike.
  int better(int k, int end) const {
    if (end - k == 1 || !stayed(k + 1)) return stayed(k) ? k : -1;
    if (!stayed(k)) return k + 1;
    const KltTrack &a = wanted[k], &b = wanted[k + 1];
    const bool same = std::hypot(a.found_x - b.found_x, a.found_y - b.found_y) < kSamePlace_px;
    if (!same && std::abs(a.correlation - b.correlation) < kAlike) return -1;
    return a.correlation >= b.correlation ? k : k + 1;
  }

  // From the first camera's image to the second one's, for each track that has no view and need not wait. What was not
  // found rests: the longer, the more often it was not.
  void match(const PyramidView& first, Tracks tracks) {
    searches = 0;
    for (int i = 0; i < size; ++i) {
      Chain& chain = chains[i];
      if (chain.matched || (chain.wait > 0 && chain.wait-- > 0)) continue;
      ++stats.tried;
      chain.wait = pause_after(++chain.failures);
      plan_match(first, tracks[i], i);
    }
    PyramidView second = current();
    second.levels = scan_level + 1;  // no search is repeated from further up: the scan has seen all places
    track_klt(config, first, second, wanted.data(), searches);
    for (int k = 0, end = 0; k < searches; k = end) {
      Chain& chain = chains[chain_of[k]];
      for (end = k + 1; end < searches && chain_of[end] == chain_of[k];) ++end;
      const int found = better(k, end);
      const TrackedFeature& feature = tracks[chain_of[k]];
      if (found < 0 || wanted[found].correlation < kLeastMatched || !take(chain, feature, wanted[found])) continue;
      if (wanted[found].patch == &templates[chain.spare]) std::swap(chain.patch, chain.spare);
      chain.matched = true;
      chain.confirmed = false;
      chain.found = feature.age;
      chain.innovation = kInnovationOfNewView_px;
      chain.failures = chain.wait = 0;
      ++stats.matched;
    }
  }

  void publish(Tracks tracks, OtherTracks& out) {
    for (int i = 0; i < size; ++i) {
      const Chain& chain = chains[i];
      if (!chain.matched || !chain.confirmed) continue;
      SecondView view;
      view.id = chain.id;
      view.age = tracks[i].age;
      view.found = chain.found;
      view.pixel = {chain.x, chain.y};
      view.row_s = static_cast<float>(chain.exposed_s);
      view.bearing = {chain.bearing.x(), chain.bearing.y(), chain.bearing.z()};
      Eigen::Map<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>>(view.pixel_jacobian.data()) = chain.pixel_jacobian;
      out.views.push_back(view);
    }
    stats.tracks += static_cast<std::uint64_t>(size);
    stats.views += out.views.size();
  }

  // As many as the first camera lacks if it has lost half of its own, else a few, which live on where it does. New ones
  // of those few are looked for now and then: most cells of the image are taken or empty of corners, and an image's
  // search costs as much as following all of them.
  void fill_alone(Tracks tracks, OtherTracks& out) {
    if (config.second_features == 0) return;
    std::size_t count = 0;
    for (int i = 0; i < size; ++i)
      if (chains[i].matched) taken[count++] = {chains[i].x, chains[i].y};
    const int first = matches ? static_cast<int>(tracks.size()) : 0;
    int most = 0;
    if (2 * first < config.max_features) {
      most = config.max_features - first;
    } else if (stats.images % kSparesEvery == 1) {
      most = std::min(config.second_features, config.max_features);
    }
    alone.fill(std::span(taken).first(count), most, first_id, out.alone);
    for (TrackedFeature& feature : out.alone) feature.row_s += static_cast<float>(motion.second_later_s);
    stats.alone += out.alone.size();
  }
};

const char* SecondTracker::why_apart(const Camera& first, const SecondRig& rig) {
  if (!(rig.p_SC.norm() >= kLeastBaseline_m)) return "the second camera is where the first one is";
  if (!(rig.R_SC(0, 0) > kLeastCosine && rig.R_SC(1, 1) > kLeastCosine && rig.R_SC(2, 2) > kLeastCosine))
    return "the second camera's axes are turned by more than about 35 degrees against those of the first one";
  const double scale = Camera(rig.camera).focal_px() / first.focal_px();
  if (!(scale < kMostScale && scale > 1 / kMostScale))
    return "the focal lengths of the two cameras, in px, differ too much";
  return nullptr;
}

SecondTracker::SecondTracker(const Camera& first, const SecondRig& rig, const TrackerConfig& config,
                             std::size_t number) {
  const char* const apart = why_apart(first, rig);
  if (apart != nullptr && config.second_features == 0) throw std::invalid_argument(apart);
  impl_ = std::make_unique<Impl>(Camera(rig.camera), rig, config, number, apart == nullptr);
}

SecondTracker::~SecondTracker() = default;

void SecondTracker::step(const PyramidView* first, std::span<const TrackedFeature> tracks, const Frame& second,
                         const Mat3& R_SS0, OtherTracks& out, const RigMotion& motion) noexcept {
  Impl& t = *impl_;
  t.motion = motion;
  t.of_stamps = t.relation_between(0, motion.second_later_s);
  ++t.stats.images;
  out.clear();
  t.take_over(tracks);
  t.sees = t.alone.follow(second, R_SS0, motion.second);
  if (!t.sees) {
    ++t.stats.images_missing;
    return t.forget_views();
  }
  if (first != nullptr && t.matches) {
    t.follow(tracks);
    t.match(*first, tracks);
    t.publish(tracks, out);
  }
  t.fill_alone(tracks, out);
}

const PyramidView* SecondTracker::pyramid() const noexcept { return impl_->sees ? &impl_->current() : nullptr; }
const SecondStats& SecondTracker::stats() const noexcept { return impl_->stats; }

}  // namespace epiline
