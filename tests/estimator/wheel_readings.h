#pragma once
#include <cmath>

#include "estimator/window/window.h"

namespace epiline::test {

/// Ways of most intervals, off the truth; slip begins between two of them.
inline void furnish_wheels(Window& w) {
  w.wheel.forward_B = Vec3(0.8, 0.6, 0);
  w.wheel.p_BV = Vec3(-0.3, 0.2, -0.1);
  w.wheel.sideways_sigma_m_s = 0.3;
  for (int k = 1; k < w.size(); ++k) {
    const NavState &from = w.at(k - 1).x, &to = w.at(k).x;
    WheelWay& way = w.at(k).wheel;
    way.known = k % 4 != 2;
    way.slips = k == 3;
    way.way = from.R.transpose() * (to.p + to.R * w.wheel.p_BV - from.p) - w.wheel.p_BV;
    way.way += (0.01 + 2e-3 * std::sin(3.0 * k)) * w.wheel.forward_B + Vec3(0, 0, 3e-3);
    way.axis_s = w.at(k).imu.T * w.wheel.forward_B;
    way.moved = 0.1 + 0.01 * k;
    way.scale = 1.1;
    way.time_of_one_s2 = 0.02 * w.at(k).imu.T;
  }
}

}  // namespace epiline::test
