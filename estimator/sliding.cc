#include <algorithm>
#include <cmath>

#include "estimator/factors/imu.h"
#include "estimator/factors/prior.h"
#include "estimator/impl.h"
#include "estimator/window/keyframe.h"

namespace epiline {

namespace {
// Beyond, the biases' first-order corrections are worth little, and the readings may be gone.
constexpr double kLongestInterval_s = 5;
constexpr double kLongRest_s = 2;         // over which the IMU loses less of the velocity than rest tells
constexpr int kLeaveAtOnce = 2;           // frames of a window that is larger than a flight's, for one that came
constexpr double kTimeOffsetWalk = 1e-5;  // s/sqrt(s)

/// Whether frame k is where a rest ended, and the velocity of what follows would hang on a frame of seconds before.
bool ends_long_rest(const Window& window, int k) {
  for (int later = k + 1; later < window.size(); ++later)
    if (window.at(later).at_rest) return false;
  return window.at(k).at_rest && window.at(k).imu.T > kLongRest_s;
}

}  // namespace

/// Whether the second newest frame says enough beside the keyframe before it to stay longer than recent frames do, or
/// others at rest are linked to it.
bool Estimator::Impl::second_newest_stays() const {
  const int k = window.size() - 2;
  int j = k - 1;
  while (j > 0 && !window.at(j).stays) --j;
  const KeyframeSettings rule{config.keyframe_parallax_px, config.extrinsics.focal_px};
  return window.at(k).id == resting.tied_to() || is_keyframe(window, j, k, rule);
}

/// The frame that has become too old to be kept for its own sake stays if it is a keyframe; a full window loses its
/// oldest frame to the prior. Until the flight has settled the scale moves, a prior would mix several, and the window
/// takes all it can. A window without room for keyframes beside the recent frames drops none.
void Estimator::Impl::slide(Supervisor& supervisor) {
  // before they have fitted a wrong number may contradict
  if (numbers.have_fitted() && marginaliser.let_step(window, solver_settings(0)))
    flight.rethinking_s = flight.after_refusal_s = kRethinking_s;
  if (window.capacity() - 2 > kRecentFrames && window.size() > 1)
    window.at(window.size() - 2).stays = second_newest_stays();
  const int k = window.size() - 2 - kRecentFrames;
  if (k >= 1) {
    if (window.at(k).stays || ends_long_rest(window, k)) {
      ++stats.keyframes;
    } else {
      thin(k);
    }
  }
  const int room = monitor.settled() ? window.capacity() : kMaxFrames;
  for (int n = 0; n < kLeaveAtOnce && window.size() >= room; ++n) marginalise(supervisor);
  window.prune();
}

/// Frame k says too little to be kept: it goes, or, so that the IMU's memory lasts, stays until two later ones were
/// kept for the same reason.
void Estimator::Impl::thin(int k) {
  if (window.at(k).imu.T + window.at(k + 1).imu.T <= kLongestInterval_s) {
    drop(k);  // or, for once, stays
    return;
  }
  window.at(k).for_time = true;
  if (k >= 3 && window.at(k - 1).for_time && window.at(k - 2).for_time) drop(k - 2);
}

/// Frame k goes: its two IMU intervals become one, its bearings are lost. False, and nothing happens: the interval
/// cannot be weighed.
bool Estimator::Impl::drop(int k) {
  Slot joint = window.at(k + 1);
  joint.wheel = window.at(k).wheel;
  joint.refused |= window.at(k).refused;
  joint.forces_doubted |= window.at(k).forces_doubted;
  joint.unknown_step = std::max(joint.unknown_step, window.at(k).unknown_step);
  joint.wheel.join(window.at(k).imu.dR, window.at(k + 1).wheel);
  joint.imu = window.at(k).imu;
  joint.imu.join(window.at(k + 1).imu);
  if (joint.imu.T > kLongestInterval_s) joint.imu.forget_motion();
  if (!whiten(joint)) return false;
  window.at(k + 1) = joint;
  marginaliser.forget_pose(window, k);
  window.remove(k);
  return true;
}

void Estimator::Impl::marginalise(Supervisor& supervisor) {
  supervisor.phase(Supervisor::Phase::kMarginalise);
  const double walked =
      kTimeOffsetWalk * std::sqrt(std::max(0., (window.at(1).time - flight.last_marginalised).seconds()));
  if (config.estimate_time_offset)
    inflate(window.prior, window.prior.calibration_row() + kTimeOffsetColumn, {&walked, 1});
  flight.last_marginalised = window.at(1).time;
  heights.remember_oldest();
  marginaliser.marginalise_oldest(window, *visual, visual_settings());
  supervisor.phase(Supervisor::Phase::kNone);
}

}  // namespace epiline
