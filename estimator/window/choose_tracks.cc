#include "estimator/window/choose_tracks.h"

#include <algorithm>

namespace epiline {

namespace {
/// The cameras whose own tracks are few beside the first one's.
std::array<bool, kMaxCameras> spare_cameras(const Window& w) {
  constexpr int kFew = 4;  // times as many
  std::array<bool, kMaxCameras> spare{};
  if (!w.rig.has_others()) return spare;
  std::array<int, kMaxCameras> tracks{};
  for (int i = 0; i < w.track_count(); ++i)
    if (w.seen(w.track(i), w.size() - 1)) ++tracks[w.track(i).camera];
  for (std::size_t c = 1; c < kMaxCameras; ++c) spare[c] = kFew * tracks[c] < tracks[0];
  return spare;
}
}  // namespace

ChosenTracks choose_tracks(Window& w, int most) noexcept {
  // One number each, whose order is the order of preference: not seen by the newest frame, id, place in the window.
  std::array<std::uint64_t, kMaxTracks> candidates;
  std::size_t n = 0;
  const std::array<bool, kMaxCameras> spare = spare_cameras(w);
  for (int i = 0; i < w.track_count(); ++i) {
    TrackRecord& t = w.track(i);
    t.in_use = !spare[t.camera];
    if (w.views(t) < 2 || !t.in_use) continue;  // one with a single view counts nowhere
    const std::uint64_t unseen = w.seen(t, w.size() - 1) ? 0 : 1;
    candidates[n++] = unseen << 63 | std::uint64_t{t.id} << 16 | static_cast<std::uint64_t>(i);
  }
  const int offered = static_cast<int>(n);
  if (most <= 0 || offered <= most) return {offered, offered};

  const auto track = [&](std::uint64_t candidate) -> TrackRecord& {
    return w.track(static_cast<int>(candidate & 0xFFFF));
  };
  auto* const end = candidates.data() + n;
  std::sort(candidates.data(), end);
  for (const auto* c = candidates.data(); c != end; ++c) track(*c).in_use = false;
  std::array<std::uint8_t, kViewCells> taken{};
  int left = most;
  for (int share = 1; left > 0; ++share) {
    for (const auto* c = candidates.data(); c != end && left > 0; ++c) {
      TrackRecord& t = track(*c);
      if (t.in_use || taken[t.cell] >= share) continue;
      t.in_use = true;
      ++taken[t.cell];
      --left;
    }
  }
  return {offered, most};
}

}  // namespace epiline
