#include "estimator/estimator.h"

#include <algorithm>
#include <memory>

#include "estimator/factors/epipolar.h"
#include "estimator/factors/reprojection.h"
#include "estimator/factors/track.h"
#include "estimator/impl.h"

namespace epiline {

namespace {
constexpr double kHeldShare = 0.2;    // of an IMU interval: the last reading may be held so long up to a frame's time
constexpr double kLongestStep_s = 5;  // a longer silence of the camera is a new start

std::unique_ptr<VisualFactorModel> make_visual_factor(VisualFactor factor, InstructionSet set) {
  switch (factor) {
    case VisualFactor::kEpipolar:
      return std::make_unique<EpipolarFactor>(set);
    case VisualFactor::kReprojection:
      return std::make_unique<ReprojectionFactor>(set);
    case VisualFactor::kTrack:
      break;
  }
  return std::make_unique<TrackFactor>(set);
}
}  // namespace

Estimator::Impl::Impl(const EstimatorConfig& c)
    : config(c),
      window(std::clamp(c.keyframes, 2, kMaxFrames - 1) + 1),
      visual(make_visual_factor(c.visual_factor, best_instruction_set())),
      solver(best_instruction_set()),
      marginaliser(best_instruction_set()),
      stationary(c.imu),
      pixel_sigma(c.pixel_sigma),
      drift_sigma(c.drift_sigma) {
  density.noise = c.imu;
  density.noise.gyroscope_density *= c.gyroscope_density_factor;
  density.noise.accelerometer_density *= c.accelerometer_density_factor;
  window.calibration = {c.extrinsics.time_offset_s, c.extrinsics.R_BC, c.extrinsics.p_BC};
  window.wheel = c.wheel;
  window.first_estimates = c.visual_factor == VisualFactor::kTrack;
  odometry.health.reasons = static_cast<std::uint32_t>(HealthReason::kNoInitialState);
}

bool Estimator::Impl::add_imu(const ImuSample& sample) {
  ++stats.imu_samples;
  switch (history.push(sample)) {
    case ImuHistory::Push::kOutOfOrder:
      ++stats.imu_out_of_order;
      return false;
    case ImuHistory::Push::kDuplicate:
      ++stats.imu_duplicate;
      return false;
    case ImuHistory::Push::kNotFinite:
      ++stats.imu_not_finite;
      return false;
    case ImuHistory::Push::kImpossible:
      ++stats.imu_impossible;
      return false;
    case ImuHistory::Push::kFarAhead:
      ++stats.imu_far_ahead;
      return false;
    case ImuHistory::Push::kTaken:
      break;
  }
  stats.imu_suspect = history.counts().suspects;
  stats.imu_bridged = history.counts().bridged;
  if (history.spikes_persist()) imu_gap_seen = true;
  if ((sample.reasons & kDistrustReasons) == 0 && !history.newest_is_suspect()) stationary.add(sample);
  const ImuHistory::Reading r = history.newest();
  if (r.w.cwiseAbs().maxCoeff() >= config.saturation_gyroscope_rad_s ||
      r.a.cwiseAbs().maxCoeff() >= config.saturation_accelerometer_m_s2 ||
      (sample.reasons & bit(HealthReason::kImuSaturated)) != 0)
    ++stats.imu_saturated;
  if (history.after_gap()) {
    ++stats.imu_gaps;
    imu_gap_seen = true;
  }
  carry_while_silent();
  return true;
}

/// The frame's exposure on the IMU's clock.
HostStamp Estimator::Impl::imu_time(HostStamp image) const {
  return image + Span::from_seconds(window.calibration.time_offset);
}

/// Linearising at a guess in place of readings would mislead the window for seconds. Without this frame, the next one
/// bridges the hole between true readings.
StepResult Estimator::Impl::refuse() {
  ++stats.frames_refused;
  return {};
}

StepResult Estimator::Impl::process(const TrackedFrame& frame, Supervisor& supervisor) {
  ++stats.frames;
  const HostStamp time = imu_time(frame.stamp);
  if (any_frame && frame.stamp <= last_frame) return refuse();
  if (!history.reaches(time)) {
    if (!started) {
      ++stats.start_refused[static_cast<int>(StartRefusal::kNoImu)];
      return refuse();
    }
    odometry.health.reasons |= bit(HealthReason::kImuSilent);
    if (odometry.health.state == HealthState::kTracking) odometry.health.state = HealthState::kDegraded;
    return refuse();
  }
  any_frame = true;
  last_frame = frame.stamp;
  if (window.size() > 0) {
    const double since_s = (frame.stamp - window.newest().image_stamp).seconds();
    if (since_s > kLongestStep_s || history.longest_unknown_s(window.newest().time, time) > kLongestUnknown_s)
      return start_anew(frame, supervisor);
    if (started && go_on_after_silence(frame)) return {true, true, false};
    if (since_s < 0.75 * config.solve_interval_s) return started ? predict(frame) : StepResult{};
  }
  if (!started) return initialise(frame, supervisor);
  const Supervisor::Effort effort = supervisor.effort();
  return effort.solve ? step(frame, supervisor, effort) : predict_for_time(frame);
}

Estimator::Estimator(const EstimatorConfig& config) : impl_(new Impl(config)) {}
Estimator::~Estimator() = default;

bool Estimator::add_imu(const ImuSample& sample) noexcept { return impl_->add_imu(sample); }

bool Estimator::add_wheel(const WheelSample& sample) noexcept {
  const bool taken = impl_->config.wheel.use && impl_->wheel.push(sample);
  ++(taken ? impl_->stats.wheel_samples : impl_->stats.wheel_refused);
  return taken;
}

HostStamp Estimator::imu_needed_until(HostStamp image) const noexcept {
  return image + Span::from_seconds(impl_->window.calibration.time_offset - kHeldShare * impl_->history.period());
}

StepResult Estimator::process(const TrackedFrame& frame, Supervisor& supervisor) noexcept {
  EstimatorStats& stats = impl_->stats;
  const std::uint64_t refused = stats.frames_refused;
  const StepResult result = impl_->process(frame, supervisor);
  if (result.solved) {
    ++stats.frames_solved;
  } else if (result.has_pose) {
    ++stats.frames_predicted;
  } else if (stats.frames_refused == refused) {
    ++stats.frames_without_pose;
  }
  return result;
}

void Estimator::start(const TrackedFrame& frame, const InitialState& state) noexcept {
  impl_->world = {};
  impl_->start(frame, state, StartKind::kGiven);
}

const Odometry& Estimator::odometry() const noexcept { return impl_->odometry; }
const EstimatorStats& Estimator::stats() const noexcept {
  impl_->stats.pixel_sigma = impl_->pixel_sigma;
  return impl_->stats;
}
Vec3 Estimator::gyroscope_bias() const noexcept {
  return impl_->carried.known ? impl_->carried.x.b_g : Vec3(Vec3::Zero());
}

}  // namespace epiline
