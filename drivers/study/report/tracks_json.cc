#include "drivers/study/report/tracks_json.h"
#include "drivers/study/report/own_parts.h"

namespace epiline {

namespace {

Json share_of(std::uint64_t part, std::uint64_t whole) {
  return whole > 0 ? Json(static_cast<double>(part) / static_cast<double>(whole)) : Json(nullptr);
}

Json other_json(std::size_t camera, const SecondStats& s) {
  return {{"camera", camera},
          {"images", s.images - s.images_missing},
          {"images_missing", s.images_missing},
          {"share_of_tracks", share_of(s.views, s.tracks)},
          {"tried", s.tried},
          {"matched", s.matched},
          {"followed", s.followed},
          {"lost", s.lost},
          {"off_plane", s.off_plane},
          {"wrong_side", s.wrong_side},
          {"tracks_of_its_own", s.alone}};
}

}  // namespace

Json tracks_json(const FlightRecord& r) {
  std::uint64_t points = 0, tracks = 0;
  for (const ImageRecord& image : r.images) {
    points += static_cast<std::uint64_t>(image.tracks);
    tracks += static_cast<std::uint64_t>(image.new_tracks);
  }
  const Json rejected =
      r.tracker ? share_of(r.tracker->rejected_near + r.tracker->rejected_wide, r.tracker->tried) : Json(nullptr);
  Json others = Json::array();
  for (std::size_t i = 0; i < r.others.size(); ++i)
    if (r.others[i]) others.push_back(other_json(i + 1, *r.others[i]));
  return {{"per_image_mean", share_of(points, r.images.size())},
          {"length_mean", share_of(points, tracks)},
          {"rejected_share", rejected},
          {"own_parts_share", r.tracker ? Json(own_share(r.tracker->own_cells)) : Json(nullptr)},
          {"noise_px", r.estimator.frames_solved > 0 ? Json(r.estimator.pixel_sigma) : Json(nullptr)},
          {"gated", r.estimator.gated},
          {"other_cameras", others}};
}

}  // namespace epiline
