#pragma once
// Tracks of a whole search from one image to another.
#include <vector>

#include "pipeline/vision/klt.h"
#include "pipeline/vision/pyramid.h"
#include "tests/pipeline/vision/support.h"

namespace epiline {

inline void track(const TrackerConfig& config, const TestImage& before, const TestImage& now,
                  std::vector<KltTrack>& tracks) {
  Pyramid a(before.width, before.height, config.levels), b(before.width, before.height, config.levels);
  a.build(before.view());
  b.build(now.view());
  std::vector<KltTemplate> patches(tracks.size());
  for (std::size_t k = 0; k < tracks.size(); ++k) tracks[k].patch = &patches[k];
  track_klt(config, a.view(), b.view(), tracks.data(), static_cast<int>(tracks.size()));
}

inline KltTrack at(double x, double y) {
  KltTrack t;
  t.x = t.found_x = static_cast<float>(x);
  t.y = t.found_y = static_cast<float>(y);
  return t;
}

inline std::vector<KltTrack> grid_of_tracks(int width, int height, int border, int step) {
  std::vector<KltTrack> tracks;
  for (int y = border; y < height - border; y += step) {
    for (int x = border; x < width - border; x += step) tracks.push_back(at(x + 0.37, y + 0.81));
  }
  return tracks;
}

}  // namespace epiline
