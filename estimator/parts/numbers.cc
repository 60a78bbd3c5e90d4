#include "estimator/parts/numbers.h"

#include <algorithm>
#include <cmath>

namespace epiline {

namespace {
constexpr double kTurnsRemembered_s = 30;  // seen by camera and gyroscope
constexpr double kJudged_s = 0.5;          // apart
constexpr auto kUnrelated = static_cast<std::size_t>(Suspect::kUnrelated),
               kTimeOffset = static_cast<std::size_t>(Suspect::kTimeOffset);
constexpr Severity kNote = Severity::kNote;
}  // namespace

RigNumbers::RigNumbers(Common& common)
    : common_(common), turns_(common.config.extrinsics.time_offset_s, kTurnsRemembered_s) {}

void RigNumbers::add(const ImuSample& reading) {
  turns_.add_reading(reading);
  units_.add(reading);
}

void RigNumbers::add(const TrackFit& tracks, double imu_chi2, double dt_s, double parallax_px, bool settled) {
  contradictions_.add(tracks, imu_chi2, dt_s, common_.window.newest().at_rest, parallax_px, settled);
}

/// The camera's pose on the IMU against the configured one.
FoundPose RigNumbers::found_pose() const {
  const CalibrationTangent d = local(common_.configured_calibration(), common_.window.calibration);
  const auto variances = common_.calibration_covariance.diagonal();
  const auto sigma = [&](int at) { return std::sqrt(variances.segment<3>(at).maxCoeff()); };
  return {d.segment<3>(kRotationColumn).norm(), sigma(kRotationColumn), d.segment<3>(kTranslationColumn).norm(),
          sigma(kTranslationColumn)};
}

/// By turns, units and contradictions.
RigNumbers::Both RigNumbers::by_sensors() const {
  const Extrinsics& given = common_.config.extrinsics;
  const Calibration& found = common_.window.calibration;
  const TurnAgreement seen = turns_.agreement();
  // turns about the axis are seen as they are, those across it as the lens shows them there
  const double middle = found.focal_ratio(), edge = middle * found.edge_magnification(),
               by_g = 1 + found.scale.gyroscope;
  const Magnified lens{std::min({1., middle, edge}), std::max({1., middle, edge})};
  Both both{suspicions_of(seen, given.R_BC, given.time_offset_s, lens, by_g),
            suspicions_of(seen, found.R_BC, found.time_offset, lens, by_g)};
  for (Suspicions* s : {&both.said, &both.left}) {
    add_suspicions(units_, *s);
    add_contradictions(contradictions_, turns_.noise_rad() * given.focal_px, *s);
  }
  Severity& unrelated = both.left[kUnrelated].severity;
  if (have_fitted()) unrelated = std::min(unrelated, Severity::kSuspect);
  return both;
}

/// What noise, wheels and the window's calibration turned out to be.
void RigNumbers::add_found(Both& both, const WheelWatch& wheels) const {
  add_suspicions(common_.config.imu, common_.noise.of_readings(), both.said);
  add_suspicions(wheels, both.said);
  // what is found in a window that contradicts itself is no finding
  if (contradictions_.worst() != Severity::kNone) return;
  const Window& window = common_.window;
  const bool stands = window.size() > 0 && window.newest().at_rest;  // which shows nothing of the pose
  if (!stands) add_pose(found_pose(), both.said);
  const CalibrationTangent sigma = common_.calibration_covariance.diagonal().cwiseSqrt();
  const Calibration& found = window.calibration;
  for (Suspicions* s : {&both.said, &both.left}) {
    add_focal_length(found.focal_ratio(), sigma[kFocalColumn], *s);
    add_lens_shape(found.edge_ratio(), Calibration::kAtEdge * sigma[kShapeColumn], *s);
    add_imu_scale(Suspect::kAccelerometerScale, 1 + found.scale.accelerometer, sigma[kAccelerometerScaleColumn], *s);
    add_imu_scale(Suspect::kGyroscopeScale, 1 + found.scale.gyroscope, sigma[kGyroscopeScaleColumn], *s);
  }
}

/// What the flight corrects for is named and no reason to distrust it, unless it is grossly wrong: what is estimated is
/// linear in the error, but for the time offset. While motion has fitted the numbers for longer than not, none is
/// accused that was not before: numbers do not change in flight, but for the stamps of a camera.
void RigNumbers::watch(const TrackedFrame& frame, const WheelWatch& wheels) {
  turns_.add_images(frame);
  const Severity contradiction = contradictions_.worst();
  if ((frame.stamp - judged_at_).seconds() < kJudged_s && contradiction <= contradiction_judged_) return;
  judged_at_ = frame.stamp;
  contradiction_judged_ = contradiction;
  Both both = by_sensors();
  add_found(both, wheels);
  wrong_ = wrong_at_rest_ = Severity::kNone;
  named_ = false;
  for (std::size_t i = 0; i < both.said.size(); ++i) {
    Suspicion& said = both.said[i];
    const Severity left = both.left[i].severity;
    wrong_ = std::max(wrong_, left);
    if (i != kUnrelated) wrong_at_rest_ = std::max(wrong_at_rest_, left);
    if (said.severity == Severity::kGross && i != kTimeOffset) wrong_ = std::max(wrong_, Severity::kSuspect);
    if (left == Severity::kNone) said.severity = std::min(said.severity, kNote);
    Suspicion& ever = common_.stats.suspicions[i];
    if (!contradictions_.may_accuse() && i != kTimeOffset)
      said.severity = std::min(said.severity, std::max(ever.severity, kNote));
    named_ = named_ || said.severity > kNote;
    if (said.severity != Severity::kNone && said.severity >= ever.severity) ever = said;
  }
}

void RigNumbers::refuse_force(double force_m_s2) {
  wrong_ = Severity::kGross;
  named_ = true;
  common_.stats.suspicions[static_cast<std::size_t>(Suspect::kAccelerometerUnits)] = {Severity::kGross, force_m_s2, {}};
}

void RigNumbers::stands() {
  if (wrong_ != Severity::kGross) return;
  turns_.forget();
  wrong_ = Severity::kNone;
}

}  // namespace epiline
