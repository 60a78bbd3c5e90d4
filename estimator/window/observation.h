#pragma once
// A view of a track, as the window keeps it. Plain numbers: the kernels' sources include them.

namespace epiline {

/// One bearing of a track, of the camera's attitude at the frame's stamp; one line of the cache. Single precision errs
/// by 1e-7 rad, a thousandth of what a tracker errs by.
struct alignas(64) Observation {
  float f_C[3];     ///< the bearing, a unit vector
  float chart[6];   ///< 2x3 row-major, maps a direction in C to pixels: d pixel / d f at f
  float bend;       ///< of the lens there: 1 as a pinhole's, 0 as a stereographic one's, below as a fisheye's
  float row_s;      ///< exposed so long after the stamp
  float age;        ///< of its track, images
  float found;      ///< by a second camera: age of the track when it was found there
  float unused[3];  ///< to the end of the line: whole vectors are read
};

inline constexpr Observation kNoView = {};

}  // namespace epiline
