#pragma once

namespace epiline {

/// What a reading less its bias has to be multiplied by, less 1: f = (1 + s_a) (a - b_a), w = (1 + s_g) (w_read - b_g).
/// So a vehicle at rest says nothing of s_g, however its bias walks.
struct ImuScale {
  double accelerometer = 0, gyroscope = 0;
};

}  // namespace epiline
