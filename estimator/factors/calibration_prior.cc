#include "estimator/factors/calibration_prior.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace epiline {

namespace {
constexpr double kFreedom = 1;  // of the Student distributions
constexpr int kRounds = 20;     // of a search for a maximum
constexpr double kSeen = 1e-4;  // of the prior's information: less is rounding, and what a solve left undone
// What a solve concludes from is not quite Gaussian, and it concludes often: so much must speak for a calibration that
// is far off.
constexpr double kClear = 30, kNear = 25;
constexpr double kFading_s = 5;     // a rotation that is seen no more: a window that says little loses it
constexpr double kSame = 0.1;       // relative difference of maxima
constexpr double kNextWidth = 1.5;  // of a Gaussian, over the one before
constexpr double kFarthest = 1;     // rad, m, relative: where the search for one that is far begins
// Relative: a scale or a focal length is estimated by its slope, which leads no farther. Turns show what is more
// (suspicion.h).
constexpr double kFarthestScale = 0.2;
// Relative: by so much do two calibrations of one lens differ in local magnification, rms over the image
// (docs/developers/decisions.md#claims-of-the-calibration).
constexpr double kLensShape = 4e-3;
constexpr double kOther = 4;    // variances of what is found: closer, the lens is as calibrated
constexpr double kByShape = 2;  // local magnification by the shape, rms over an image of 80 degrees

double square(double x) { return x * x; }
double freedom_and_numbers(const CalibrationPart& p) { return kFreedom + p.numbers; }
/// The scale s for a standard deviation sigma near the centre, where the information is (nu + n)/(nu s^2).
double scale_squared(const CalibrationPart& p) { return square(p.sigma) * freedom_and_numbers(p) / kFreedom; }
double weight(const CalibrationPart& p, double distance_squared) {
  return freedom_and_numbers(p) / (kFreedom * scale_squared(p) + distance_squared);
}
double cost(const CalibrationPart& p, double distance_squared) {
  return freedom_and_numbers(p) * std::log1p(distance_squared / (kFreedom * scale_squared(p)));
}

/// Where the prior's weight is taken, squared.
double distance_squared(const CalibrationPart& p, const CalibrationTangent& d) {
  return std::max(d.segment(p.at, p.numbers).squaredNorm(), square(p.found));
}

template <int numbers>
using Numbers = Eigen::Matrix<double, numbers, 1>;

/// What is measured of a part without its prior, chi^2 = d'H d - 2 b'd + a constant, along the axes of H.
template <int numbers>
struct Measured {
  Numbers<numbers> h, b;

  Numbers<numbers> at_weight(double w) const { return b.array() / (h.array() + w); }
  double chi2(const Numbers<numbers>& d) const { return (h.array() * d.array() - 2 * b.array()).matrix().dot(d); }
};

/// The maximum of both that is reached from a weight of the prior.
template <int numbers>
Numbers<numbers> maximum(const CalibrationPart& p, const Measured<numbers>& m, double w) {
  Numbers<numbers> d = m.at_weight(w);
  for (int i = 0; i < kRounds; ++i) {
    const Numbers<numbers> next = m.at_weight(weight(p, d.squaredNorm()));
    if (next == d) break;
    d = next;
  }
  return d;
}

/// Mean of x x', x the truth less `solved`, on the axes of the measured. How wrong the configured number may be is not
/// known: any width of a Gaussian between sigma and `kWidest` is as likely.
template <int numbers>
Eigen::Matrix<double, numbers, numbers> mean_square_from(const Numbers<numbers>& solved, const CalibrationPart& p,
                                                         Measured<numbers> m) {
  constexpr double kWidest = numbers == 1 ? kFarthestScale : kFarthest;
  for (int i = 0; i < numbers; ++i)
    if (m.h[i] < 1 / square(kWidest)) m.h[i] = m.b[i] = 0;
  Eigen::Matrix<double, numbers, numbers> sum = Eigen::Matrix<double, numbers, numbers>::Zero();
  double mass = 0, likeliest = 0;
  for (double width = p.sigma; mass == 0 || width < kWidest; width *= kNextWidth) {
    const double w = 1 / square(width);
    const Numbers<numbers> mean = m.at_weight(w), off = mean - solved;
    const double log_mass = (m.b.dot(mean) - (m.h / w).array().log1p().sum()) / 2;
    if (log_mass > likeliest) {
      sum *= std::exp(likeliest - log_mass);
      mass *= std::exp(likeliest - log_mass);
      likeliest = log_mass;
    }
    const double share = std::exp(log_mass - likeliest);
    sum += share * off * off.transpose();
    sum.diagonal() += share * (m.h.array() + w).inverse().matrix();
    mass += share;
  }
  return sum / mass;
}

/// The other maximum of a rotation, unless the one remembered still says more of the error.
void remember(const Vec3& other, double elsewhere, const Vec3& solved, double fading, CalibrationPart& p) {
  p.elsewhere *= fading;
  if (elsewhere * (other - solved).squaredNorm() >= p.elsewhere * (p.other - solved).squaredNorm()) {
    p.elsewhere = elsewhere;
    p.other = other;
  }
  p.doubt = p.elsewhere * (p.other - solved) * (p.other - solved).transpose();
}

template <int numbers>
bool look_far(const CalibrationCovariance& covariance, const CalibrationTangent& linearised,
              const CalibrationTangent& solved, double fading, CalibrationPart& p) {
  using Block = Eigen::Matrix<double, numbers, numbers>;
  const Numbers<numbers> d = solved.segment<numbers>(p.at);
  const Block I = covariance.block<numbers, numbers>(p.at, p.at).inverse();
  const Eigen::SelfAdjointEigenSolver<Block> axes(I);
  const double held = weight(p, distance_squared(p, linearised));
  const Measured<numbers> all{axes.eigenvalues().array() - held, axes.eigenvectors().transpose() * (I * d)};
  Measured<numbers> m = all;
  for (int i = 0; i < numbers; ++i)
    if (m.h[i] < kSeen * weight(p, 0)) m.h[i] = m.b[i] = 0;
  const Numbers<numbers> near = maximum(p, m, weight(p, 0)), far = maximum(p, m, weight(p, square(kFarthest)));
  const auto both = [&](const Numbers<numbers>& x) { return m.chi2(x) + cost(p, x.squaredNorm()); };
  const bool held_near = square(p.found) < kNear * scale_squared(p);
  const double gain = both(near) - both(far);
  const bool in_reach = numbers > 1 || far.norm() < kFarthestScale;
  const bool takes_far = in_reach && gain > (held_near ? kClear : 0);
  p.found = takes_far ? far.norm() : near.norm();
  if (p.at == kRotationColumn) {
    if constexpr (numbers == 3) {
      // of a maximum: its height times its width
      const auto log_mass = [&](const Numbers<numbers>& x) {
        return -(both(x) + (m.h.array() + weight(p, x.squaredNorm())).log().sum()) / 2;
      };
      const Vec3 &here = takes_far ? far : near, &there = takes_far ? near : far;
      const bool two = (there - here).norm() > kSame * far.norm();
      remember(axes.eigenvectors() * there, two ? 1 / (1 + std::exp(log_mass(here) - log_mass(there))) : 0, d, fading,
               p);
    }
  } else {
    const Block of_truth = mean_square_from<numbers>(axes.eigenvectors().transpose() * d, p, all);
    p.doubt.template topLeftCorner<numbers, numbers>() =
        axes.eigenvectors() * of_truth * axes.eigenvectors().transpose() -
        covariance.block<numbers, numbers>(p.at, p.at);
  }
  return held_near && square(p.found) >= kNear * scale_squared(p);
}
}  // namespace

CalibrationTangent calibration_prior_information(const CalibrationPrior& prior, const CalibrationTangent& d) noexcept {
  CalibrationTangent information = CalibrationTangent::Zero();
  for (const CalibrationPart* p : prior.parts())
    if (p->sigma > 0) information.segment(p->at, p->numbers).setConstant(weight(*p, distance_squared(*p, d)));
  return information;
}

double add_calibration_prior(const Window& w, const Share& share, NormalEquations* out) {
  const CalibrationPrior& prior = w.calibration_prior;
  if (share.oldest_only) return 0;
  const CalibrationTangent d = local(prior.configured, w.calibration);
  double sum = 0;
  for (const CalibrationPart* part : prior.parts()) {
    const CalibrationPart& p = *part;
    if (!(p.sigma > 0)) continue;
    const double d2 = d.segment(p.at, p.numbers).squaredNorm(), at2 = distance_squared(p, d);
    sum += cost(p, at2) + weight(p, at2) * (d2 - at2);  // within what was found, the parabola that touches the cost
  }
  if (!out) return sum;
  const CalibrationTangent information = calibration_prior_information(prior, d);
  // Of the rotation, too: J_r^-T(d) d = d.
  out->add(calibration_of_camera(), CalibrationTangent(-information.cwiseProduct(d)));
  out->add(calibration_of_camera(), calibration_of_camera(), CalibrationCovariance(information.asDiagonal()));
  return sum;
}

bool look_far(const CalibrationCovariance& covariance, const Calibration& linearised, const Calibration& solved,
              double dt_s, CalibrationPrior& prior) noexcept {
  const double fading = std::exp(-dt_s / kFading_s);
  const CalibrationTangent d0 = local(prior.configured, linearised), d = local(prior.configured, solved);
  bool found = false;
  for (CalibrationPart* p : prior.parts())
    if (p->sigma > 0)
      found |=
          p->numbers == 1 ? look_far<1>(covariance, d0, d, fading, *p) : look_far<3>(covariance, d0, d, fading, *p);
  return found;
}

namespace {
template <int numbers>
void add_growth(const CalibrationPart& p, const CalibrationCovariance& covariance, CalibrationCovariance& G) {
  using Block = Eigen::Matrix<double, numbers, numbers>;
  const auto P = covariance.block<numbers, numbers>(p.at, p.at).ldlt();
  const Block by_doubt = P.solve(p.doubt.topLeftCorner<numbers, numbers>());
  G.block<numbers, numbers>(p.at, p.at) += P.solve(by_doubt.transpose());
}
}  // namespace

CalibrationCovariance growth_by_tails(const CalibrationPrior& prior, const CalibrationCovariance& covariance) noexcept {
  CalibrationCovariance G = CalibrationCovariance::Zero();
  for (const CalibrationPart* p : prior.parts())
    if (p->sigma > 0) p->numbers == 1 ? add_growth<1>(*p, covariance, G) : add_growth<3>(*p, covariance, G);
  return G;
}

// A lens that is not as it was calibrated is not in all else, which two numbers do not tell.
LensDoubt doubt_of_lens(const CalibrationPrior& prior, const Calibration& solved,
                        const CalibrationCovariance& covariance, const Rig& rig) noexcept {
  const CalibrationTangent d = local(prior.configured, solved);
  const auto off = [&](int at) { return square(d[at]) > kOther * covariance(at, at) ? std::abs(d[at]) : 0; };
  const double shape = std::min(off(kFocalColumn) + kByShape * off(kShapeColumn), kLensShape);
  double baseline = 0;
  for (std::size_t i = 1; i < rig.poses.size(); ++i)
    if (rig.use[i]) baseline = std::max(baseline, rig.poses[i].p_CD.norm());
  const double depth = baseline > 0 ? std::min(prior.translation.sigma / baseline, kLensShape) : 0;
  const auto of = [](const CalibrationPart& p, double variance) { return p.sigma > 0 ? variance : 0; };
  return {of(prior.focal, square(shape) + square(depth)), of(prior.shape, square(shape / kByShape)),
          of(prior.accelerometer_scale, square(shape)), of(prior.gyroscope_scale, square(shape))};
}

CalibrationCovariance growth_by_doubt(const LensDoubt& doubt, const CalibrationCovariance& covariance) noexcept {
  CalibrationCovariance P = covariance;
  for (int i = 0; i < kCalibration; ++i)
    if (!(P(i, i) > 0)) P(i, i) = 1;  // not estimated: no state follows it
  const Eigen::Matrix<double, kCalibration, 4> rows =
      P.ldlt().solve(CalibrationCovariance::Identity().middleCols<4>(kFocalColumn));
  return rows * doubt.asDiagonal() * rows.transpose();
}

}  // namespace epiline
