#include "pipeline/stages/prediction.h"

#include <utility>

namespace epiline {

void Prediction::correct(const Estimate& newest) noexcept {
  if (std::exchange(resets_seen_, newest.odometry.reset_counter) != newest.odometry.reset_counter) predictor_.clear();
  const bool is_new = std::exchange(corrected_with_, newest.solved_serial) != newest.solved_serial;
  if (is_new && newest.solved.reset_counter == newest.odometry.reset_counter) predictor_.correct(newest.solved);
}

bool Prediction::step(const ImuSample& reading) noexcept {
  return predictor_.add_imu(reading) == ImuHistory::Push::kTaken && has_odometry();
}

Odometry Prediction::odometry(const Estimate* newest) const noexcept {
  Odometry odometry = predictor_.odometry();
  if (newest != nullptr && predictor_.state() == Predictor::State::kCurrent) odometry.health = newest->odometry.health;
  return odometry;
}

}  // namespace epiline
