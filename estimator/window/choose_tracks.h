#pragma once
#include "estimator/window/window.h"

namespace epiline {

struct ChosenTracks {
  int offered = 0;  ///< tracks with two views or more
  int used = 0;
};

/// Decides which tracks the visual factors use (TrackRecord::in_use): all, or the `most` (0: no limit) that say most.
/// Those the newest frame sees come before the others, of each the oldest first, as long as their cell of the view, 64
/// pixels wide, has no more than its share. An old track stays old, so the choice hardly changes from frame to frame;
/// and since the window keeps the bearings of all, a track that comes back has lost nothing.
ChosenTracks choose_tracks(Window& window, int most) noexcept;

}  // namespace epiline
