#include "drivers/study/calibrate/turn_alignment.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "estimator/geometry/so3.h"

namespace epiline {

namespace {

/// The gyroscope's readings added up, so that a mean rate costs two look-ups. Turns between images are small enough
/// for rates to be added.
class AddedRates {
 public:
  explicit AddedRates(const std::vector<ImuSample>& imu) : imu_(imu), sums_(imu.size(), Vec3::Zero()) {
    for (std::size_t i = 1; i < imu.size(); ++i)
      sums_[i] = sums_[i - 1] + 0.5 * (rate(i - 1) + rate(i)) * (imu[i].stamp - imu[i - 1].stamp).seconds();
  }
  bool covers(HostStamp from, HostStamp to) const { return from >= imu_.front().stamp && to <= imu_.back().stamp; }
  /// Requires covers().
  Vec3 mean(HostStamp from, HostStamp to) const { return (until(to) - until(from)) / (to - from).seconds(); }

 private:
  Vec3 rate(std::size_t i) const { return vec3(imu_[i].angular_velocity_rad_s); }
  Vec3 until(HostStamp t) const {
    const auto after = std::upper_bound(imu_.begin() + 1, imu_.end() - 1, t,
                                        [](HostStamp s, const ImuSample& sample) { return s < sample.stamp; });
    const auto i = static_cast<std::size_t>(after - imu_.begin());
    const double T = (imu_[i].stamp - imu_[i - 1].stamp).seconds(), s = (t - imu_[i - 1].stamp).seconds();
    const Vec3 at_end = rate(i - 1) + s / T * (rate(i) - rate(i - 1));
    return sums_[i - 1] + 0.5 * s * (rate(i - 1) + at_end);
  }
  const std::vector<ImuSample>& imu_;
  std::vector<Vec3> sums_;
};

/// A camera's mean rate between two images, in the camera as it stood half way.
struct CameraRate {
  HostStamp from, to;
  Vec3 omega_C;
};

std::vector<CameraRate> rates_of(const std::vector<CameraOrientation>& turns) {
  constexpr double kLongest_s = 0.3;
  std::vector<CameraRate> rates;
  for (std::size_t i = 1; i < turns.size(); ++i) {
    const double T = (turns[i].stamp - turns[i - 1].stamp).seconds();
    if (!(T > 0 && T < kLongest_s)) continue;
    rates.push_back({turns[i - 1].stamp, turns[i].stamp, so3_log(turns[i - 1].R_TC.transpose() * turns[i].R_TC) / T});
  }
  return rates;
}

struct Matched {
  TurnAlignment alignment;
  std::size_t pairs = 0;
  double second_axis = 0;  ///< rms rate about the axis with the second most, rad/s
};

Matched match(const std::vector<CameraRate>& rates, const AddedRates& gyroscope, double offset_s,
              const std::vector<bool>& trusted) {
  const Span offset{std::llround(offset_s * 1e9)};
  std::vector<std::pair<Vec3, Vec3>> both;
  Vec3 mean_B = Vec3::Zero(), mean_C = Vec3::Zero();
  for (std::size_t i = 0; i < rates.size(); ++i) {
    const HostStamp from = rates[i].from + offset, to = rates[i].to + offset;
    if (!trusted[i] || !gyroscope.covers(from, to)) continue;
    both.emplace_back(gyroscope.mean(from, to), rates[i].omega_C);
    mean_B += both.back().first;
    mean_C += both.back().second;
  }
  Matched matched;
  matched.pairs = both.size();
  if (both.size() < 3) return matched;
  const double n = static_cast<double>(both.size());
  mean_B /= n;
  mean_C /= n;
  Mat3 M = Mat3::Zero(), spread = Mat3::Zero();
  for (const auto& [omega_B, omega_C] : both) {
    M += (omega_B - mean_B) * (omega_C - mean_C).transpose() / n;
    spread += (omega_C - mean_C) * (omega_C - mean_C).transpose() / n;
  }
  const Eigen::JacobiSVD<Mat3> svd(M, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  TurnAlignment& a = matched.alignment;
  a.R_BC = svd.matrixU() * Vec3(1, 1, sign).asDiagonal() * svd.matrixV().transpose();
  a.gyroscope_bias = mean_B - a.R_BC * mean_C;
  a.time_offset_s = offset_s;
  for (const auto& [omega_B, omega_C] : both)
    a.misfit_rad_s += (omega_B - a.gyroscope_bias - a.R_BC * omega_C).squaredNorm() / n;
  a.misfit_rad_s = std::sqrt(a.misfit_rad_s);
  matched.second_axis = std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Mat3>(spread).eigenvalues()[1]));
  return matched;
}

Matched best_within(const std::vector<CameraRate>& rates, const AddedRates& gyroscope, double centre, double reach,
                    double step, const std::vector<bool>& trusted) {
  Matched best;
  best.alignment.misfit_rad_s = std::numeric_limits<double>::infinity();
  for (double offset = centre - reach; offset <= centre + reach + 0.5 * step; offset += step) {
    Matched matched = match(rates, gyroscope, offset, trusted);
    if (matched.pairs >= rates.size() / 2 && matched.pairs >= 3 &&
        matched.alignment.misfit_rad_s < best.alignment.misfit_rad_s)
      best = std::move(matched);
  }
  return best;
}

/// Distrusts the pairs that are far off with this alignment: a pose of few corners may be mirrored.
void distrust_far_ones(const std::vector<CameraRate>& rates, const AddedRates& gyroscope, const TurnAlignment& a,
                       std::vector<bool>& trusted) {
  const Span offset{std::llround(a.time_offset_s * 1e9)};
  for (std::size_t i = 0; i < rates.size(); ++i) {
    const HostStamp from = rates[i].from + offset, to = rates[i].to + offset;
    if (!gyroscope.covers(from, to)) continue;
    const Vec3 off = gyroscope.mean(from, to) - a.gyroscope_bias - a.R_BC * rates[i].omega_C;
    trusted[i] = off.norm() < 3 * a.misfit_rad_s + 0.01;
  }
}

}  // namespace

Result<TurnAlignment> align_turns(const std::vector<CameraOrientation>& turns, const std::vector<ImuSample>& imu) {
  const auto fail = [](std::string found, std::string expected) {
    return Error{ErrorKind::kRun, "", 0, std::move(found), std::move(expected)};
  };
  constexpr std::size_t kLeastPairs = 20;
  constexpr double kLeastTurn_rad_s = 0.1;
  const std::vector<CameraRate> rates = rates_of(turns);
  if (rates.size() < kLeastPairs || imu.size() < 3) {
    return fail(fmt::format("{} pairs of neighbouring images show the board", rates.size()),
                fmt::format("{} at least, less than 0.3 s apart", kLeastPairs));
  }
  const AddedRates gyroscope(imu);
  std::vector<bool> trusted(rates.size(), true);
  Matched best;
  for (int pass = 0; pass < 3; ++pass) {
    best = best_within(rates, gyroscope, 0, 0.5, 0.01, trusted);
    best = best_within(rates, gyroscope, best.alignment.time_offset_s, 0.01, 0.0005, trusted);
    if (best.pairs < kLeastPairs) {
      return fail("images and readings of the IMU do not cover the same time", "one recording of both, on one clock");
    }
    distrust_far_ones(rates, gyroscope, best.alignment, trusted);
  }
  if (best.second_axis < kLeastTurn_rad_s) {
    return fail(fmt::format("the camera turns about one axis only ({:.2f} rad/s rms about the next)", best.second_axis),
                "turns about all three axes: nod, shake and roll the rig");
  }
  if (best.alignment.misfit_rad_s > 0.5 * best.second_axis) {
    return fail(
        fmt::format("the camera's turns do not fit the gyroscope's (off by {:.2f} rad/s)", best.alignment.misfit_rad_s),
        "images and readings of one rig on one clock; angular rates in rad/s");
  }
  return best.alignment;
}

}  // namespace epiline
