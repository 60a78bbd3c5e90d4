#pragma once
// What the tests of whole starts share.
#include <cmath>

#include "estimator/initialise/start_point.h"

namespace epiline::test {

/// On the widest vectors of this machine.
inline PointElimination& work_space() {
  static PointElimination points(best_instruction_set());
  return points;
}

inline double angle(const Vec3& a, const Vec3& b) { return std::atan2(a.cross(b).norm(), a.dot(b)); }

}  // namespace epiline::test
