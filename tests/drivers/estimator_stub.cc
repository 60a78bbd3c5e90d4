// Stands in for the estimator until it exists: a circle, for the plumbing around it.
#include <cmath>

#include "estimator/estimator.h"

namespace epiline {
const char* to_string(StartRefusal) { return "refused"; }
struct Estimator::Impl {
  EstimatorStats stats;
  Odometry odometry;
  HostStamp first{}, last_imu{};
};
Estimator::Estimator(const EstimatorConfig&) : impl_(std::make_unique<Impl>()) {}
Estimator::~Estimator() = default;
bool Estimator::add_imu(const ImuSample& s) noexcept {
  if (impl_->stats.imu_samples > 0 && s.stamp <= impl_->last_imu) {
    ++impl_->stats.imu_out_of_order;
    return false;
  }
  impl_->last_imu = s.stamp;
  ++impl_->stats.imu_samples;
  return true;
}
HostStamp Estimator::imu_needed_until(HostStamp image) const noexcept { return image; }
StepResult Estimator::process(const TrackedFrame& frame, Supervisor& s) noexcept {
  auto& o = impl_->odometry;
  if (impl_->stats.frames++ == 0) impl_->first = frame.stamp;
  const double t = (frame.stamp - impl_->first).seconds();
  if (t < 0.5) return {};
  s.phase(Supervisor::Phase::kSolve);
  double sum = 0;
  for (int i = 0; i < 100000 + static_cast<int>(frame.features.size()) * 300; ++i) sum += std::sqrt(i);
  s.phase(Supervisor::Phase::kMarginalise);
  for (int i = 0; i < 30000; ++i) sum += std::sqrt(i);
  s.phase(Supervisor::Phase::kNone);
  o.stamp = frame.stamp;
  o.p_WB_m = {std::cos(t), std::sin(0.9 * t), 0.3 * std::sin(2 * t) + 0 * sum};
  o.v_WB_m_s = {-std::sin(t), 0.9 * std::cos(0.9 * t), 0.6 * std::cos(2 * t)};
  o.gyroscope_bias_rad_s = {0.01, 0.02, -0.01};
  o.accelerometer_bias_m_s2 = {0.01 * t, 0.2, -0.1};
  for (int i = 0; i < 16; ++i) o.covariance[static_cast<std::size_t>(17 * i)] = i < 6 ? 1e-4 + 2e-4 * t : i < 12 ? 4e-3 / (1 + t) : 1e-6 / (1 + t);
  o.health.state = t < 1 ? HealthState::kInitialising : t > 12 && t < 14 ? HealthState::kDegraded : HealthState::kTracking;
  o.health.quality = 80 - static_cast<int>(10 * std::sin(t));
  ++impl_->stats.frames_solved;
  return {true, true, false};
}
const Odometry& Estimator::odometry() const noexcept { return impl_->odometry; }
const EstimatorStats& Estimator::stats() const noexcept { return impl_->stats; }
Vec3 Estimator::gyroscope_bias() const noexcept { return Vec3::Zero(); }
}  // namespace epiline
