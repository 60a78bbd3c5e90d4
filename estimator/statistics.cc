#include "estimator/statistics.h"

namespace epiline {

const char* to_string(StartRefusal r) {
  constexpr std::array kNames = {"too_few_frames",  "too_few_tracks",     "no_imu",         "no_parallax",
                                 "solver_failed",   "residual_too_large", "tilt_uncertain", "velocity_uncertain",
                                 "scale_uncertain", "bias_implausible",   "numbers_wrong"};
  static_assert(kNames.size() == static_cast<std::size_t>(StartRefusal::kCount));
  return r < StartRefusal::kCount ? kNames[static_cast<std::size_t>(r)] : "unknown";
}

}  // namespace epiline
