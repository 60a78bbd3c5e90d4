#include "estimator/window/choose_tracks.h"

#include <algorithm>

namespace epiline {

namespace {
/// Whether the second camera's own tracks are few beside the first one's.
bool second_is_spare(const Window& w) {
  constexpr int kFew = 4;  // times as many
  int by_first = 0, by_second = 0;
  for (int i = 0; i < w.track_count(); ++i)
    if (w.seen(w.track(i), w.size() - 1)) ++(w.track(i).by_second ? by_second : by_first);
  return kFew * by_second < by_first;
}
}  // namespace

ChosenTracks choose_tracks(Window& w, int most) noexcept {
  // One number each, whose order is the order of preference: not seen by the newest frame, id, place in the window.
  std::array<std::uint64_t, kMaxTracks> candidates;
  std::size_t n = 0;
  const bool spare = w.rig.use && second_is_spare(w);
  for (int i = 0; i < w.track_count(); ++i) {
    TrackRecord& t = w.track(i);
    t.in_use = !(spare && t.by_second);
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
