#pragma once
#include "estimator/window/window.h"

namespace epiline {

struct ChosenTracks {
  int offered = 0;  ///< tracks with two views or more
  int used = 0;
};

/// Decides which tracks the visual factors use (TrackRecord::in_use): all, or the `most` (0: no limit) most informative
/// ones. Tracks seen by the newest frame come first, and among these the oldest, limited to a fair share for each cell
/// of the image (64 pixels wide). The choice hardly changes from frame to frame, because an old track stays old. The
/// window keeps the bearings of all tracks, so a track that is chosen again has lost nothing. Tracks of the second
/// camera alone wait for when they are needed: they are used where they are a fourth of the first camera's or more.
ChosenTracks choose_tracks(Window& window, int most) noexcept;

}  // namespace epiline
