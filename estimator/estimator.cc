#include "estimator/estimator.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "estimator/factors/track.h"
#include "estimator/geometry/row_turn.h"
#include "estimator/impl.h"
#include "estimator/monitor/evidence.h"

namespace epiline {

namespace {
constexpr double kHeldShare = 0.2;    // share of an IMU interval for which the last sample may be held
constexpr int kCopies = 3;            // in a row, as many as the image gate leaves out
constexpr double kMovesBy = 3;        // sigmas of its velocity
constexpr double kLongestStep_s = 5;  // a longer silence of the camera is a new start

std::unique_ptr<VisualFactorModel> make_visual(const VisualFactor& factor, InstructionSet set) {
  if (factor.make != nullptr) return factor.make(set);
  return std::make_unique<TrackFactor>(set);
}

Rig rig_of(const EstimatorConfig& c) {
  Rig rig;
  const bool counts = c.track_noise == TrackNoiseModel::kDrift;
  const Mat3 R_CB = c.extrinsics.R_BC.transpose();
  for (std::size_t i = 0; i < kMostOthers; ++i) {
    const OtherCamera& other = c.others[i];
    rig.use[i + 1] = other.use && counts;
    rig.poses[i + 1] = {R_CB * other.R_BC, R_CB * (other.p_BC - c.extrinsics.p_BC)};
  }
  return rig;
}
}  // namespace

Common::Common(const EstimatorConfig& c)
    : config(c), noise(config), window(std::clamp(c.keyframes, 2, kMaxFrames - 1) + 1) {
  window.calibration = window.calibration_prior.configured = configured_calibration();
  window.rig = rig_of(c);
  window.wheel = c.wheel;
  for (std::size_t i = 0; i < kHeightKinds; ++i) window.height_sigmas_m[i] = c.heights[i].sigma_m;
}

Estimator::Impl::Impl(const EstimatorConfig& c)
    : Common(c),
      visual(make_visual(c.visual_factor, best_instruction_set())),
      solver(best_instruction_set()),
      marginaliser(best_instruction_set()),
      starter(best_instruction_set()),
      flight(config) {
  CalibrationPrior& prior = window.calibration_prior;
  if (c.estimate_extrinsics) {
    prior.rotation.sigma = c.extrinsic_rotation_sigma_rad;
    prior.translation.sigma = c.extrinsic_translation_sigma_m;
  }
  if (c.estimate_focal_length) prior.focal.sigma = prior.shape.sigma = c.focal_length_sigma;
  if (c.estimate_imu_scale) {
    prior.accelerometer_scale.sigma = c.accelerometer_scale_sigma;
    prior.gyroscope_scale.sigma = c.gyroscope_scale_sigma;
  }
  odometry.health = monitor.health();
}

/// The configured densities within what the readings allow. Where that moves them, the window's intervals are weighed
/// anew.
void Estimator::Impl::hold_noise() {
  if (!noise.hold()) return;
  resting.assume(noise.of_readings());
  intervals.weigh_anew();
}

/// Whether it is in the history.
bool Estimator::Impl::count(ImuHistory::Push outcome) {
  switch (outcome) {
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
  return true;
}

bool Estimator::Impl::add_imu(const ImuSample& given) {
  ++stats.imu_samples;
  ImuSample sample = given;
  const auto largest = [](const std::array<double, 3>& axes) { return Vec3(axes.data()).cwiseAbs().maxCoeff(); };
  if (largest(given.angular_velocity_rad_s) >= config.saturation_gyroscope_rad_s ||
      largest(given.specific_force_m_s2) >= config.saturation_accelerometer_m_s2)
    sample.reasons |= bit(HealthReason::kImuSaturated);
  if (!count(history.push(sample))) return false;
  if (history.spikes_persist()) imu_gap_seen = true;
  if ((sample.reasons & kDistrustReasons) == 0) {
    noise.add(sample);
    numbers.add(sample);
    if (!history.newest_is_suspect()) resting.add(sample);
  }
  if ((sample.reasons & bit(HealthReason::kImuSaturated)) != 0) {
    ++stats.imu_saturated;
    imu_gap_seen = true;
  }
  if (history.after_gap()) {
    ++stats.imu_gaps;
    imu_gap_seen = true;
  }
  carrying.keep_up();
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

/// A camera that repeats an image has taken none: its tracks are where they were, to the last bit. More copies than
/// that are a scene without noise.
bool Estimator::Impl::is_copy(const TrackedFrame& frame) {
  const auto same = [](const TrackedFeature& a, const TrackedFeature& b) {
    return a.id == b.id && a.bearing == b.bearing;
  };
  const auto &now = frame.features, &before = door.before;
  const bool copy = !now.empty() && std::equal(now.begin(), now.end(), before.begin(), before.end(), same);
  door.copies = copy ? door.copies + 1 : 0;
  door.before.copy(now);
  return copy && door.copies <= kCopies;
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
  door.changed.copy(frame);
  for (TrackedFeature& f : door.changed.features) turn_to_stamp(rows, f);
  for (std::size_t i = 0; i < kMostOthers; ++i) {
    if (!window.rig.use[i + 1]) continue;
    const RowTurn of_other = rows.seen_from(window.rig.poses[i + 1].R_CD);
    for (SecondView& v : door.changed.others[i].views) turn_to_stamp(of_other, v);
    for (TrackedFeature& f : door.changed.others[i].alone) turn_to_stamp(of_other, f);
  }
  return door.changed;
}

/// Whether it is known that the vehicle moves. A camera at rest sees others move past what stays, too.
bool Estimator::Impl::moves() const {
  if (!started) return resting.is_restless();
  return carried.x.v.norm() > kMovesBy * sigma_velocity(carried.x, carried.P);
}

/// Tracks of the vehicle's own parts tell nothing about its motion; what the window has of them goes, too. They stay in
/// the image `given`, as it was exposed.
const TrackedFrame& Estimator::Impl::without_fixed(const TrackedFrame& given, const TrackedFrame& frame) {
  const double sigma = std::min(flight.tracks.pixel_sigma, resting.pixel_noise());
  if (door.fixed.update(given, sigma, moves()) && window.size() > 0)
    window.forget([this](const TrackRecord& t) { return t.camera == 0 && door.fixed.contains(t.id); });
  if (door.fixed.empty()) return frame;
  if (&frame != &door.changed) door.changed.copy(frame);
  const auto leave_out = [this](auto& list) {
    const auto* end =
        std::remove_if(list.begin(), list.end(), [this](const auto& f) { return door.fixed.contains(f.id); });
    list.resize(static_cast<std::size_t>(end - list.begin()));
  };
  leave_out(door.changed.features);
  for (OtherTracks& other : door.changed.others) leave_out(other.views);
  return door.changed;
}

StepResult Estimator::Impl::process(const TrackedFrame& given, Supervisor& supervisor) {
  ++stats.frames;
  const HostStamp time = imu_time(given.stamp);
  if (door.any_frame && given.stamp <= door.last_frame) return refuse();
  const bool silent = window.size() > 0 && intervals.is_silent(window.newest().time, time);
  const double gap_s = (given.stamp - door.last_offered).seconds();
  const bool follows = gap_s <= kLongestUnknown_s;  // else its stamp may be wrong
  const bool images_go_on = silent && (follows || history.reaches(time)) && images_suffice(given);
  door.period_s = door.period_s > 0 ? std::min(gap_s, 1.1 * door.period_s) : gap_s;
  door.last_offered = given.stamp;
  if (!history.reaches(time) && !images_go_on) {
    if (!started) {
      ++stats.start_refused[static_cast<int>(StartRefusal::kNoImu)];
      return refuse();
    }
    monitor.say(HealthReason::kImuSilent);
    return refuse();
  }
  const bool copy = is_copy(given);
  const TrackedFrame& all = at_stamp(given);
  door.any_frame = true;
  door.last_frame = all.stamp;
  if (window.size() > 0) {
    const double since_s = (all.stamp - window.newest().image_stamp).seconds();
    if (since_s > kLongestStep_s || (silent && !images_go_on)) return start_anew(all, supervisor);
    if (started && go_on_after_silence(all)) return {true, true};
    if (copy || since_s < 0.75 * config.solve_interval_s)
      return silent ? refuse() : started ? predict(all) : StepResult{};
  }
  hold_noise();
  if (!is_blind(all.reasons) && !silent) numbers.watch(all, wheels.words());
  const TrackedFrame& frame = without_fixed(given, all);
  if (!started) return initialise(frame, supervisor);
  const Supervisor::Effort effort = supervisor.effort();
  return effort.solve ? step(frame, supervisor, effort) : predict_for_time(frame);
}

Estimator::Estimator(const EstimatorConfig& config) : impl_(new Impl(config)) {}
Estimator::~Estimator() = default;

bool Estimator::add_imu(const ImuSample& sample) noexcept { return impl_->add_imu(sample); }

bool Estimator::add_wheel(const WheelSample& sample) noexcept { return impl_->wheels.add(sample); }

bool Estimator::add_height(const HeightSample& sample) noexcept { return impl_->heights.add(sample); }

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
  impl_->odometry.health = impl_->monitor.health();
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
  if (!std::exchange(impl_->flight.may_slide, false)) return false;
  const std::uint64_t before = impl_->stats.keyframes;
  impl_->slide(supervisor);
  return impl_->stats.keyframes > before;
}

void Estimator::start(const TrackedFrame& frame, const InitialState& state) noexcept {
  impl_->world = {};
  impl_->start(impl_->at_stamp(frame), state, StartKind::kGiven);
  impl_->odometry.health = impl_->monitor.health();
}

const Odometry& Estimator::odometry() const noexcept { return impl_->odometry; }
const EstimatorStats& Estimator::stats() const noexcept {
  impl_->stats.pixel_sigma = impl_->flight.tracks.pixel_sigma;
  return impl_->stats;
}
Vec3 Estimator::gyroscope_bias() const noexcept {
  return impl_->carried.known ? impl_->carried.x.b_g : Vec3(Vec3::Zero());
}

}  // namespace epiline
