#include "estimator/monitor/suspicion.h"

#include <algorithm>
#include <cmath>

#include "estimator/geometry/so3.h"

namespace epiline {

namespace {
constexpr double kRate = 0.15;   // rad/s: slower turns say little
constexpr double kAgree = 0.95;  // of the camera's and the gyroscope's turns, once all is fitted
constexpr double kAgreeMirrored = 0.8, kLeftByMirror = 0.4;  // of what the best rotation leaves
constexpr double kAgreeOnScale = 0.985, kScale = 0.07, kGrossScale = 0.13;
constexpr double kUnits = 8;  // degrees make it 57
constexpr double kUnrelated = 0.35;
constexpr double kManyTurns = 60;
constexpr double kRotation = 0.15, kGrossRotation = 0.35;  // rad
constexpr double kPlace_m = 0.03, kGrossPlace_m = 0.25;
constexpr double kSigmas = 6, kAgreeOnRotation = 0.97;
constexpr double kOffset_s = 0.02, kGrossOffset_s = 0.04;
// The configured offset must agree worse by so much, or by so much of what even the best one leaves.
constexpr double kOffsetLoss = 0.002, kOffsetLossOfRest = 0.5;
constexpr double kWeakestAxis = 0.15;
constexpr double kMisfitRatio = 2;  // over the error between two images: noisy tracks contradict nobody
constexpr Span kUnitsSpan = Span::from_milliseconds(5000);
// m/s^2: a mean over five seconds between what a flight can have and what wrong units, off by 9.8 at least, make of 1 g
constexpr double kLeastForce = 3.1, kMostForce = 31;
constexpr double kMostRate = 6;                           // rad/s, likewise: one turn a second for five seconds
constexpr double kFocalLength = 0.015, kFocalSigmas = 6;  // relative: worth a word beyond
constexpr double kFarFocalLength = 0.035;  // what is estimated is linear in it: by 5 % it is off by a fifth of that
constexpr double kFarLensShape = 0.06;     // guessed lenses of a GoPro are 3 to 5 % off
constexpr double kImuScale = 0.02, kFarImuScale = 0.05;  // sensors err by 1 to 3 %: a lens may look like more
constexpr double kNoiseFactor = 3;                       // users widen and vibration adds: worth a word beyond

/// The signed axes of the gyroscope that would make it agree: column k is where its axis k points.
TurnedAxes axes_of(const Mat3& M) {
  TurnedAxes axes{};
  for (int k = 0; k < 3; ++k) {
    int row = 0;
    M.col(k).cwiseAbs().maxCoeff(&row);
    axes[static_cast<std::size_t>(k)] = static_cast<std::int8_t>(M(row, k) < 0 ? -(row + 1) : row + 1);
  }
  return axes;
}
}  // namespace

Suspicions suspicions_of(const TurnAgreement& t, const Mat3& R_BC, double time_offset_s, const Magnified& lens,
                         double gyroscope_ratio) noexcept {
  Suspicions s;
  const auto raise = [&](Suspect what, bool gross, double figure) {
    s[static_cast<std::size_t>(what)] = {gross ? Severity::kGross : Severity::kSuspect, figure, {}};
  };
  if (!(t.turns > 0) || t.rate_rad_s < kRate) return s;
  const double best = std::max(t.agreement, t.agreement_mirrored);
  if (best > 0.5 && (t.rate_ratio > kUnits || t.rate_ratio < 1 / kUnits)) {
    raise(Suspect::kGyroscopeUnits, true, t.rate_ratio);
    return s;
  }
  // of a gyroscope that turns less than the camera seems to, as over a plane, the camera's error explains that
  if (t.turns > kManyTurns && best < kUnrelated * std::min(1.0, t.rate_ratio)) raise(Suspect::kUnrelated, true, best);
  if (t.agreement_mirrored > kAgreeMirrored && 1 - t.agreement_mirrored < kLeftByMirror * (1 - t.agreement)) {
    raise(Suspect::kMirrored, true, t.agreement_mirrored);
    // b = mirrored_BC c, where a right gyroscope would say R_BC c
    s[static_cast<std::size_t>(Suspect::kMirrored)].axes = axes_of(t.mirrored_BC * R_BC.transpose());
    return s;
  }
  if (t.agreement < kAgree) return s;
  const double low = 1 / (lens.most * gyroscope_ratio), high = 1 / (lens.least * gyroscope_ratio);
  // the noise of either may have made its rates look larger
  const double least = t.rate_ratio * t.agreement, most = t.rate_ratio / t.agreement;
  if (t.turns > kManyTurns && t.agreement > kAgreeOnScale && (least > high + kScale || most < low - kScale))
    raise(Suspect::kScale, t.rate_ratio > high + kGrossScale || t.rate_ratio < low - kGrossScale, t.rate_ratio);
  const double offset_s = t.time_offset_s - time_offset_s;
  const double clear = std::max(kOffsetLoss, kOffsetLossOfRest * (1 - t.agreement));
  if (std::abs(offset_s) > kOffset_s && t.offset_loss > clear)
    raise(Suspect::kTimeOffset, std::abs(offset_s) > kGrossOffset_s, offset_s);
  const Vec3 off = so3_log(t.R_BC.transpose() * R_BC);
  const double sigma = std::sqrt(std::max(0.0, off.normalized().dot(t.R_BC_covariance * off.normalized())));
  if (t.turns < kManyTurns || t.agreement < kAgreeOnRotation || t.weakest_axis < kWeakestAxis ||
      off.norm() < std::max(kRotation, kSigmas * sigma))
    return s;
  const bool gross = off.norm() > kGrossRotation;
  const double inverted = so3_log(R_BC * t.R_BC).norm();
  if (gross && inverted < kGrossRotation / 2)
    raise(Suspect::kInverted, true, inverted);
  else
    raise(Suspect::kRotation, gross, off.norm());
  return s;
}

void add_suspicions(const ImuNoise& configured, const ImuNoise& used, Suspicions& s) noexcept {
  const auto add = [&](Suspect what, double factor) {
    if (factor > kNoiseFactor || factor < 1 / kNoiseFactor)
      s[static_cast<std::size_t>(what)] = {Severity::kNote, factor, {}};
  };
  add(Suspect::kGyroscopeNoise, used.gyroscope_density / configured.gyroscope_density);
  add(Suspect::kAccelerometerNoise, used.accelerometer_density / configured.accelerometer_density);
}

namespace {
/// A ratio that the flight found to be another than 1: worth a word beyond `least`, and more than a note beyond `far`.
void add_ratio(Suspect suspect, double ratio, double sigma, double least, double far, Suspicions& s) {
  const double off = std::abs(ratio - 1);
  if (sigma > 0 && off > std::max(least, kFocalSigmas * sigma))
    s[static_cast<std::size_t>(suspect)] = {off > far ? Severity::kSuspect : Severity::kNote, ratio, {}};
}
}  // namespace

void add_focal_length(double ratio, double sigma, Suspicions& s) noexcept {
  add_ratio(Suspect::kFocalLength, ratio, sigma, kFocalLength, kFarFocalLength, s);
}

void add_lens_shape(double ratio, double sigma, Suspicions& s) noexcept {
  add_ratio(Suspect::kLensShape, ratio, sigma, kFocalLength, kFarLensShape, s);
}

void add_pose(const FoundPose& found, Suspicions& s) noexcept {
  const auto raise = [&](Suspect what, double figure, double sigma, double least, double gross) {
    Suspicion& one = s[static_cast<std::size_t>(what)];
    if (sigma > 0 && figure > std::max(least, kSigmas * sigma) && one.severity == Severity::kNone)
      one = {figure > gross ? Severity::kGross : Severity::kNote, figure, {}};
  };
  if (s[static_cast<std::size_t>(Suspect::kInverted)].severity == Severity::kNone)
    raise(Suspect::kRotation, found.rotation_rad, found.rotation_sigma, kRotation, kGrossRotation);
  raise(Suspect::kPlace, found.place_m, found.place_sigma, kPlace_m, kGrossPlace_m);
}

void add_imu_scale(Suspect suspect, double ratio, double sigma, Suspicions& s) noexcept {
  add_ratio(suspect, ratio, sigma, kImuScale, kFarImuScale, s);
}

void add_contradictions(const ContradictionWatch& watch, double pair_px, Suspicions& s) noexcept {
  const auto add = [&](Suspect what, const Contradiction& c) {
    s[static_cast<std::size_t>(what)] = {c.severity(), c.figure(), {}};
  };
  if (watch.misfit_px().figure() > kMisfitRatio * pair_px) add(Suspect::kMisfit, watch.misfit_px());
  add(Suspect::kImuMisfit, watch.imu_chi2());
  add(Suspect::kBehind, watch.behind());
}

bool can_be_gravity(double force_m_s2) noexcept { return force_m_s2 > kLeastForce && force_m_s2 < kMostForce; }

void add_suspicions(const UnitsWatch& units, Suspicions& s) noexcept {
  const double force = units.force_m_s2(), rate = units.rate_rad_s();
  if (force > 0 && !can_be_gravity(force))
    s[static_cast<std::size_t>(Suspect::kAccelerometerUnits)] = {Severity::kGross, force, {}};
  Suspicion& gyroscope = s[static_cast<std::size_t>(Suspect::kGyroscopeUnits)];
  if (rate > kMostRate && gyroscope.severity == Severity::kNone) gyroscope = {Severity::kGross, -rate, {}};
}

void UnitsWatch::add(const ImuSample& reading) noexcept {
  if (count_ == 0) begin_ = reading.stamp;
  force_sum_ += Vec3::Map(reading.specific_force_m_s2.data()).norm();
  rate_sum_ += Vec3::Map(reading.angular_velocity_rad_s.data()).norm();
  ++count_;
  if (reading.stamp - begin_ < kUnitsSpan) return;
  force_ = force_sum_ / count_;
  rate_ = rate_sum_ / count_;
  force_sum_ = rate_sum_ = 0;
  count_ = 0;
}

}  // namespace epiline
