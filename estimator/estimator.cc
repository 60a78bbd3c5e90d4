#include "estimator/estimator.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "estimator/factors/epipolar.h"
#include "estimator/factors/reprojection.h"
#include "estimator/factors/track.h"
#include "estimator/geometry/row_turn.h"
#include "estimator/impl.h"

namespace epiline {

namespace {
constexpr double kHeldShare = 0.2;     // share of an IMU interval for which the last sample may be held
constexpr double kWatchMemory_s = 30;  // turns seen by camera and gyroscope
constexpr double kNoiseMoved = 0.1;    // of a density: not worth weighing the window anew
constexpr double kJudgeNumbers_s = 0.5;
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

Rig rig_of(const EstimatorConfig& c) {
  Rig rig;
  const bool counts = c.visual_factor == VisualFactor::kTrack && c.track_noise == TrackNoiseModel::kDrift;
  const Mat3 R_CB = c.extrinsics.R_BC.transpose();
  for (std::size_t i = 0; i < kMostOthers; ++i) {
    const OtherCamera& other = c.others[i];
    rig.use[i + 1] = other.use && counts;
    rig.poses[i + 1] = {R_CB * other.R_BC, R_CB * (other.p_BC - c.extrinsics.p_BC)};
  }
  return rig;
}
}  // namespace

Estimator::Impl::Impl(const EstimatorConfig& c)
    : config(c),
      window(std::clamp(c.keyframes, 2, kMaxFrames - 1) + 1),
      visual(make_visual_factor(c.visual_factor, best_instruction_set())),
      solver(best_instruction_set()),
      marginaliser(best_instruction_set()),
      stationary(c.imu),
      starter(best_instruction_set()),
      turns(c.extrinsics.time_offset_s, kWatchMemory_s),
      wheel_watch(c.wheel.scale_sigma),
      pixel_sigma(c.pixel_sigma),
      drift_sigma(kUsualDrift) {
  use_noise(c.imu);
  window.calibration = configured_calibration();
  window.calibration_prior.configured = window.calibration;
  if (c.estimate_extrinsics) {
    window.calibration_prior.rotation.sigma = c.extrinsic_rotation_sigma_rad;
    window.calibration_prior.translation.sigma = c.extrinsic_translation_sigma_m;
  }
  if (estimates_focal_length()) window.calibration_prior.focal.sigma = c.focal_length_sigma;
  if (c.estimate_imu_scale) {
    window.calibration_prior.accelerometer_scale.sigma = c.accelerometer_scale_sigma;
    window.calibration_prior.gyroscope_scale.sigma = c.gyroscope_scale_sigma;
  }
  window.rig = rig_of(c);
  window.wheel = c.wheel;
  for (std::size_t i = 0; i < kHeightKinds; ++i) window.height_sigmas_m[i] = c.heights[i].sigma_m;
  odometry.health.reasons = static_cast<std::uint32_t>(HealthReason::kNoInitialState);
}

void Estimator::Impl::use_noise(const ImuNoise& n) {
  noise = n;
  density.noise = in_flight(config, n);
  density.noise.accelerometer_random_walk *= accelerometer_walk.factor();
  density.noise.gyroscope_random_walk *= gyroscope_walk.factor();
  stationary.assume(n);
}

/// The configured densities within what the readings allow. Where that moves them, the window's intervals are weighed
/// anew.
void Estimator::Impl::hold_noise() {
  const ImuNoise before = density.noise, held_before = noise;
  use_noise(noise_bounds.hold(config.imu));
  const auto moved = [](double from, double to) { return std::abs(to - from) > kNoiseMoved * from; };
  if (!moved(before.gyroscope_density, density.noise.gyroscope_density) &&
      !moved(before.accelerometer_density, density.noise.accelerometer_density) &&
      !moved(before.gyroscope_random_walk, density.noise.gyroscope_random_walk) &&
      !moved(before.accelerometer_random_walk, density.noise.accelerometer_random_walk)) {
    use_noise(held_before);
    density.noise = before;
    return;
  }
  for (int k = 1; k < window.size(); ++k) integrate_again(k, window.at(k).imu.b_a, window.at(k).imu.b_g);
}

bool Estimator::Impl::add_imu(const ImuSample& given) {
  ++stats.imu_samples;
  ImuSample sample = given;
  const auto largest = [](const std::array<double, 3>& axes) { return Vec3(axes.data()).cwiseAbs().maxCoeff(); };
  if (largest(given.angular_velocity_rad_s) >= config.saturation_gyroscope_rad_s ||
      largest(given.specific_force_m_s2) >= config.saturation_accelerometer_m_s2)
    sample.reasons |= bit(HealthReason::kImuSaturated);
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
  if ((sample.reasons & kDistrustReasons) == 0) {
    noise_bounds.add(sample);
    turns.add_reading(sample);
    units.add(sample);
    if (!history.newest_is_suspect()) stationary.add(sample);
  }
  if ((sample.reasons & bit(HealthReason::kImuSaturated)) != 0) ++stats.imu_saturated;
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

/// What keeps the odometry from being good.
void Estimator::Impl::say(HealthReason reason) {
  odometry.health.reasons |= bit(reason);
  if (odometry.health.state == HealthState::kTracking) odometry.health.state = HealthState::kDegraded;
}

/// The camera's pose on the IMU against the configured one.
FoundPose Estimator::Impl::found_pose() const {
  const CalibrationTangent d = local(configured_calibration(), window.calibration);
  const auto sigma = [&](int at) { return std::sqrt(calibration_covariance.diagonal().segment<3>(at).maxCoeff()); };
  return {d.segment<3>(kRotationColumn).norm(), sigma(kRotationColumn), d.segment<3>(kTranslationColumn).norm(),
          sigma(kTranslationColumn)};
}

/// Whether the user's numbers can be true (docs/derivations/turns.md); of every image that is due for a solve. What the
/// flight corrects for is named and no reason to distrust it, unless it is grossly wrong: what is estimated is linear
/// in the error.
void Estimator::Impl::watch_numbers(const TrackedFrame& frame) {
  turns.add_images(frame);
  const Severity contradiction = contradictions.worst();
  if ((frame.stamp - numbers_judged_at).seconds() < kJudgeNumbers_s && contradiction <= contradiction_judged) return;
  numbers_judged_at = frame.stamp;
  contradiction_judged = contradiction;
  const TurnAgreement seen = turns.agreement();
  const double focal_ratio = window.calibration.focal_ratio();
  const ImuScale& scale = window.calibration.scale;
  const double by_a = 1 + scale.accelerometer, by_g = 1 + scale.gyroscope;
  Suspicions said = suspicions_of(seen, config.extrinsics.R_BC, config.extrinsics.time_offset_s, focal_ratio, by_g);
  Suspicions left = suspicions_of(seen, window.calibration.R_BC, window.calibration.time_offset, focal_ratio, by_g);
  add_suspicions(units, said);
  add_suspicions(units, left);
  const double pair_px = turns.noise_rad() * config.extrinsics.focal_px;
  add_contradictions(contradictions, pair_px, said);
  add_contradictions(contradictions, pair_px, left);
  constexpr auto kUnrelated = static_cast<std::size_t>(Suspect::kUnrelated);
  if (contradictions.numbers_fitted()) {
    said[kUnrelated] = {};
    left[kUnrelated].severity = std::min(left[kUnrelated].severity, Severity::kSuspect);
  }
  add_suspicions(config.imu, noise, said);
  add_suspicions(wheel_watch, said);
  const CalibrationTangent sigma = calibration_covariance.diagonal().cwiseSqrt();
  // what is found in a window that contradicts itself is no finding
  if (contradiction == Severity::kNone) add_pose(found_pose(), said);
  for (Suspicions* s : {&said, &left}) {
    if (contradiction != Severity::kNone) break;
    add_focal_length(focal_ratio, sigma[kFocalColumn], *s);
    add_imu_scale(Suspect::kAccelerometerScale, by_a, sigma[kAccelerometerScaleColumn], *s);
    add_imu_scale(Suspect::kGyroscopeScale, by_g, sigma[kGyroscopeScaleColumn], *s);
  }
  numbers_wrong = wrong_at_rest = Severity::kNone;
  for (std::size_t i = 0; i < said.size(); ++i) {
    numbers_wrong = std::max(numbers_wrong, left[i].severity);
    if (i != kUnrelated) wrong_at_rest = std::max(wrong_at_rest, left[i].severity);
    if (said[i].severity == Severity::kGross) numbers_wrong = std::max(numbers_wrong, Severity::kSuspect);
    if (said[i].severity > Severity::kNote && left[i].severity == Severity::kNone) said[i].severity = Severity::kNote;
    if (said[i].severity != Severity::kNone && said[i].severity >= stats.suspicions[i].severity)
      stats.suspicions[i] = said[i];
  }
}

/// How long before and after a frame's stamp its bearings are exposed, s; 0: all of them at the stamp.
double Estimator::Impl::exposed_within_s() const {
  double within_s = 0.5 * std::abs(config.extrinsics.readout_s);
  for (std::size_t i = 0; i < kMostOthers; ++i)
    if (window.rig.use[i + 1])
      within_s = std::max(within_s, config.others[i].apart_s + 0.5 * std::abs(config.others[i].readout_s));
  return within_s;
}

namespace {
/// From the attitude that its camera had when the bearing was exposed to that at the stamp. Feature: TrackedFeature or
/// SecondView.
template <class Feature>
void turn_to_stamp(const RowTurn& rows, Feature& f) {
  const Mat3 R = rows.at(static_cast<double>(f.row_s));
  Eigen::Map<Vec3> bearing(f.bearing.data());
  Eigen::Map<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>> chart(f.pixel_jacobian.data());
  bearing = (R * bearing).eval();
  chart = (chart * R.transpose()).eval();
}
}  // namespace

/// Bearings turn from the time of their exposure to the stamp; where the camera was then is left to the factor
/// (docs/derivations/rolling_shutter.md).
const TrackedFrame& Estimator::Impl::at_stamp(const TrackedFrame& frame) {
  const double within_s = exposed_within_s();
  if (within_s == 0) return frame;
  const HostStamp time = imu_time(frame.stamp);
  const auto turn = [&](HostStamp from, HostStamp to) {
    NavState x{.b_g = known_gyroscope_bias()};
    Vec3 rate;
    history.propagate(from, to, window.calibration.scale, x, rate);
    return x.R;
  };
  const Span within = Span::from_seconds(within_s);
  const RowTurn rows =
      row_turn(turn(time - within, time), turn(time, time + within), within_s, window.calibration.R_BC);
  turned.copy(frame);
  for (TrackedFeature& f : turned.features) turn_to_stamp(rows, f);
  for (std::size_t i = 0; i < kMostOthers; ++i) {
    if (!window.rig.use[i + 1]) continue;
    const RowTurn of_other = rows.seen_from(window.rig.poses[i + 1].R_CD);
    for (SecondView& v : turned.others[i].views) turn_to_stamp(of_other, v);
    for (TrackedFeature& f : turned.others[i].alone) turn_to_stamp(of_other, f);
  }
  return turned;
}

StepResult Estimator::Impl::process(const TrackedFrame& given, Supervisor& supervisor) {
  ++stats.frames;
  const HostStamp time = imu_time(given.stamp);
  if (any_frame && given.stamp <= last_frame) return refuse();
  const bool silent = window.size() > 0 && is_silent(window.newest().time, time);
  const bool follows = (given.stamp - last_offered).seconds() <= kLongestUnknown_s;  // else its stamp may be wrong
  const bool images_go_on = silent && (follows || history.reaches(time)) && images_suffice(given);
  last_offered = given.stamp;
  if (!history.reaches(time) && !images_go_on) {
    if (!started) {
      ++stats.start_refused[static_cast<int>(StartRefusal::kNoImu)];
      return refuse();
    }
    say(HealthReason::kImuSilent);
    return refuse();
  }
  const TrackedFrame& frame = at_stamp(given);
  any_frame = true;
  last_frame = frame.stamp;
  if (window.size() > 0) {
    const double since_s = (frame.stamp - window.newest().image_stamp).seconds();
    if (since_s > kLongestStep_s || (silent && !images_go_on)) return start_anew(frame, supervisor);
    if (started && go_on_after_silence(frame)) return {true, true};
    if (since_s < 0.75 * config.solve_interval_s) return silent ? refuse() : started ? predict(frame) : StepResult{};
  }
  hold_noise();
  if (!is_blind(frame.reasons) && !silent) watch_numbers(frame);
  if (!started) return initialise(frame, supervisor);
  const Supervisor::Effort effort = supervisor.effort();
  return effort.solve ? step(frame, supervisor, effort) : predict_for_time(frame);
}

Estimator::Estimator(const EstimatorConfig& config) : impl_(new Impl(config)) {}
Estimator::~Estimator() = default;

bool Estimator::add_imu(const ImuSample& sample) noexcept { return impl_->add_imu(sample); }

bool Estimator::add_wheel(const WheelSample& sample) noexcept { return impl_->add_wheel(sample); }

bool Estimator::add_height(const HeightSample& sample) noexcept { return impl_->add_height(sample); }

HostStamp Estimator::imu_needed_until(HostStamp image) const noexcept {
  // up to the exposure of the last row, and to the printed stamp, to which the odometry is taken on
  const double offset_s = std::max(0.0, impl_->window.calibration.time_offset + impl_->exposed_within_s());
  return image + Span::from_seconds(offset_s - kHeldShare * impl_->history.period());
}

StepResult Estimator::process(const TrackedFrame& frame, Supervisor& supervisor) noexcept {
  EstimatorStats& stats = impl_->stats;
  slide(supervisor);
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

bool Estimator::slide(Supervisor& supervisor) noexcept {
  if (!std::exchange(impl_->may_slide, false)) return false;
  const std::uint64_t before = impl_->stats.keyframes;
  impl_->slide(supervisor);
  return impl_->stats.keyframes > before;
}

void Estimator::start(const TrackedFrame& frame, const InitialState& state) noexcept {
  impl_->world = {};
  impl_->start(impl_->at_stamp(frame), state, StartKind::kGiven);
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
