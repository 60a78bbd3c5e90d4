#include "pipeline/stages/publish_stage.h"

#include <utility>

namespace epiline {

/// Not handed out yet; valid until the next call.
const Estimate* PublishStage::new_estimate() noexcept {
  const Estimate* const newest = in_.newest.read();
  return newest != nullptr && newest->serial != last_serial_ ? newest : nullptr;
}

bool PublishStage::ready() noexcept {
  return in_.estimator_ended.is_set() || new_estimate() != nullptr || in_.imu.front() != nullptr;
}

Step PublishStage::step() noexcept {
  const bool over = in_.estimator_ended.is_set();  // before the look at the inputs: what came before the end is found
  if (const Estimate* const estimate = new_estimate()) {
    publish(*estimate);
    correct(*estimate);
    if (!estimate->has_pose) publish_silence();  // images may come on while the IMU is silent. Last: it reads anew
  } else if (const ImuSample* const reading = in_.imu.front()) {
    publish_prediction(*reading);
    in_.imu.pop();
  } else {
    return over ? Step::end() : nothing_new();
  }
  silent_from_ns_ = 0;
  return Step::work();
}

Step PublishStage::nothing_new() noexcept {
  const std::int64_t now = clock_.now_ns();
  if (silent_from_ns_ != 0 && now >= silent_from_ns_) publish_silence();
  if (silent_from_ns_ == 0 || now >= silent_from_ns_) silent_from_ns_ = now + kIdle.ns;
  return Step::nothing_until(silent_from_ns_);
}

/// The verdict of the last image, and what its sensors have done since.
Health PublishStage::health_now(const Health& health) const noexcept {
  if (in_.camera_ended.is_set() || in_.imu_ended.is_set()) return health;  // a recording that is over is no silence
  const LastHeard heard{in_.camera_heard.last(), in_.imu_heard.last(), in_.camera_heard.period(),
                        in_.imu_heard.period()};
  return with_silence(health, heard, clock_.stamp_now());
}

void PublishStage::correct(const Estimate& newest) noexcept {
  if (std::exchange(resets_seen_, newest.odometry.reset_counter) != newest.odometry.reset_counter) predictor_.clear();
  const bool is_new = std::exchange(corrected_with_, newest.solved_serial) != newest.solved_serial;
  if (is_new && newest.solved.reset_counter == newest.odometry.reset_counter) predictor_.correct(newest.solved);
}

/// At the last reading. As long as the last solve is not old, the verdict is that on the last image, which may be worse
/// than that on the last solve.
Odometry PublishStage::prediction_now() noexcept {
  Odometry odometry = predictor_.odometry();
  const Estimate* const newest = in_.newest.read();
  if (newest != nullptr && predictor_.state() == Predictor::State::kCurrent) odometry.health = newest->odometry.health;
  odometry.health = health_now(odometry.health);
  return odometry;
}

void PublishStage::publish_silence() noexcept {
  if (out_.odometry == nullptr || predictor_.state() == Predictor::State::kWaiting) return;
  const Odometry odometry = prediction_now();
  const std::uint32_t silent = bit(HealthReason::kCameraSilent) | bit(HealthReason::kImuSilent);
  if ((odometry.health.reasons & silent) != 0 && !out_.odometry->publish(odometry)) counts_.predict_failed.bump();
}

void PublishStage::publish(const Estimate& estimate) noexcept {
  last_serial_ = estimate.serial;
  counts_.published.bump();
  if (!estimate.has_pose) return;
  if (out_.odometry != nullptr) {
    Odometry odometry = estimate.odometry;
    odometry.health = health_now(odometry.health);
    if (!out_.odometry->publish_image(odometry)) counts_.publish_failed.bump();
  }
  const std::int64_t latency_ns = clock_.now_ns() - clock_.pace->host_of(estimate.odometry.stamp);
  if (deadline_ms_ > 0 && 1e-6 * static_cast<double>(latency_ns) > deadline_ms_) counts_.late.bump();
  out_.publications.push({estimate.serial - 1, latency_ns});
  out_.log.notify();
}

void PublishStage::publish_prediction(const ImuSample& reading) noexcept {
  const bool taken = predictor_.add_imu(reading) == ImuHistory::Push::kTaken;
  if (!taken || predictor_.state() == Predictor::State::kWaiting) return;
  const Odometry odometry = prediction_now();
  if (out_.odometry != nullptr && !out_.odometry->publish(odometry)) counts_.predict_failed.bump();
  prediction_latency_.add(clock_.now_ns() - clock_.pace->host_of(reading.stamp));
  counts_.predicted.bump();
}

}  // namespace epiline
