#pragma once
#include <cmath>

#include "estimator/window/window.h"

namespace epiline::test {

/// Readings of both sensors in most frames, off the truth, of two series each; a tilted beam of some metres.
inline void furnish_heights(Window& w) {
  w.height_sigmas_m = {0.05, 0.03};
  for (int k = 0; k < w.size(); ++k) {
    Slot& slot = w.at(k);
    const double off = 0.04 * std::sin(3.0 * k);
    slot.heights[0] = {k % 4 != 3, k == 4 ? 2U : 1U, slot.x.p.z() + 20 + off, Vec3::Zero(), 1e-3 * k};
    const Vec3 lever(1.1, -0.8, -2.0 - 0.1 * k);
    slot.heights[1] = {k % 5 != 1, k < 3 ? 1U : 2U, 0, lever + off * Vec3::UnitZ(), 2e-4 * k * k};
  }
}

}  // namespace epiline::test
