#include "drivers/program/check/hand_wave.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "estimator/geometry/so3.h"

namespace epiline {

namespace {

constexpr double kReach_s = 0.25, kStep_s = 0.004;  // offsets looked at
constexpr std::size_t kFewBearings = 12, kFewTurns = 30;
constexpr double kFarBearing = 0.003;  // rad: residuals of bearings beyond count less
constexpr int kRounds = 5;
constexpr double kDegree = std::numbers::pi / 180;

/// The rotation that takes a to b best, from the sum of b a^T.
Mat3 rotation_from(const Mat3& sum) {
  const Eigen::JacobiSVD<Mat3> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  return svd.matrixU() * Vec3(1, 1, sign).asDiagonal() * svd.matrixV().transpose();
}

/// Integral of the gyroscope since the first reading, at any instant in between.
class Integral {
 public:
  explicit Integral(const std::vector<ImuSample>& readings) : readings_(readings), sums_(readings.size()) {
    Vec3 sum = Vec3::Zero();
    for (std::size_t i = 0; i < readings.size(); ++i) {
      if (i > 0) sum += 0.5 * (rate(i) + rate(i - 1)) * (readings[i].stamp - readings[i - 1].stamp).seconds();
      sums_[i] = sum;
    }
  }
  bool covers(HostStamp from, HostStamp to) const {
    return readings_.size() > 1 && from >= readings_.front().stamp && to <= readings_.back().stamp;
  }
  /// covers() it.
  Vec3 at(HostStamp stamp) const {
    const auto after = std::upper_bound(readings_.begin() + 1, readings_.end() - 1, stamp,
                                        [](HostStamp s, const ImuSample& r) { return s < r.stamp; });
    const auto i = static_cast<std::size_t>(after - readings_.begin());
    const double dt = (stamp - readings_[i - 1].stamp).seconds();
    const double whole = (readings_[i].stamp - readings_[i - 1].stamp).seconds();
    const double part = whole > 0 ? dt / whole : 0;
    return sums_[i - 1] + dt * (rate(i - 1) * (1 - part / 2) + rate(i) * (part / 2));
  }

 private:
  Vec3 rate(std::size_t i) const { return Vec3::Map(readings_[i].angular_velocity_rad_s.data()); }
  const std::vector<ImuSample>& readings_;
  std::vector<Vec3> sums_;
};

struct Fit {
  double agreement = -1;
  Mat3 R_BC = Mat3::Identity();
  Vec3 spread = Vec3::Zero();  ///< singular values
};

}  // namespace

namespace {

using Bearings = std::vector<Vec3>;

/// As if everything were far away.
Mat3 turn_of_far_points(const Bearings& before, const Bearings& now) {
  Mat3 R_CC0 = Mat3::Identity();
  std::vector<double> weights(before.size(), 1);
  for (int round = 0; round < kRounds; ++round) {
    Mat3 sum = Mat3::Zero();
    for (std::size_t i = 0; i < before.size(); ++i) sum += weights[i] * now[i] * before[i].transpose();
    R_CC0 = rotation_from(sum);
    for (std::size_t i = 0; i < before.size(); ++i) {
      const double off = (now[i] - R_CC0 * before[i]).norm() / kFarBearing;
      weights[i] = 1 / (1 + off * off);
    }
  }
  return R_CC0;
}

/// Turn and direction of travel, improved together: Gauss-Newton, Cauchy weights on the angles to epipolar planes.
class Travel {
 public:
  Travel(const Bearings& before, const Bearings& now, const Mat3& R_CC0, const Vec3& direction)
      : before_(before), now_(now), R_(R_CC0), t_(direction) {
    cost_ = cost(R_, t_);
    for (int i = 0; i < kSteps && step(); ++i) {
    }
  }
  double cost() const { return cost_; }
  const Mat3& turn() const { return R_; }

 private:
  static constexpr int kSteps = 10;
  static constexpr double kOff = 0.001;  // rad
  using Vec5 = Eigen::Matrix<double, 5, 1>;
  using Mat5 = Eigen::Matrix<double, 5, 5>;

  /// From the bearing before, turned, to the plane of the bearing now and the direction.
  static double angle(const Vec3& turned, const Vec3& now, const Vec3& t, double& scale) {
    scale = 1 / std::max(t.cross(now).norm(), 0.1);
    return scale * t.dot(turned.cross(now));
  }
  double cost(const Mat3& R, const Vec3& t) const {
    double sum = 0, scale = 0;
    for (std::size_t i = 0; i < now_.size(); ++i) {
      const double off = angle(R * before_[i], now_[i], t, scale) / kOff;
      sum += std::log1p(off * off);
    }
    return sum;
  }
  bool step() {
    const Vec3 other = std::abs(t_.x()) < 0.6 ? Vec3::UnitX() : Vec3::UnitY();
    Eigen::Matrix<double, 3, 2> across;  // of the direction
    across.col(0) = t_.cross(other).normalized();
    across.col(1) = t_.cross(across.col(0));
    Mat5 H = Mat5::Zero();
    Vec5 b = Vec5::Zero();
    for (std::size_t i = 0; i < now_.size(); ++i) {
      const Vec3 g = R_ * before_[i];
      double scale = 0;
      const double e = angle(g, now_[i], t_, scale);
      Vec5 J;
      J.head<3>() = scale * (t_.dot(g) * now_[i] - g.dot(now_[i]) * t_);
      J.tail<2>() = scale * (across.transpose() * g.cross(now_[i]));
      const double weight = 1 / (1 + e * e / (kOff * kOff));
      H += weight * J * J.transpose();
      b -= weight * e * J;
    }
    H.diagonal().array() += 1e-6 * static_cast<double>(now_.size());  // a direction nobody sees stays
    const Vec5 d = H.ldlt().solve(b);
    const Mat3 R = so3_exp(d.head<3>()) * R_;
    const Vec3 t = (t_ + across * d.tail<2>()).normalized();
    const double next = cost(R, t);
    if (!(next < cost_)) return false;
    const bool goes_on = cost_ - next > 1e-4 * cost_;
    R_ = R;
    t_ = t;
    cost_ = next;
    return goes_on;
  }

  const Bearings &before_, &now_;
  Mat3 R_;
  Vec3 t_;
  double cost_ = 0;
};

}  // namespace

bool turn_between(const std::vector<Vec3>& before, const std::vector<Vec3>& now, Mat3& R_CC0) {
  if (before.size() < kFewBearings) return false;
  const Mat3 far = turn_of_far_points(before, now);
  double least = std::numeric_limits<double>::infinity();
  for (const Vec3& direction : {Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1), Vec3(1, 1, 1).normalized().eval(),
                                Vec3(1, -1, 1).normalized().eval()}) {
    const Travel travel(before, now, far, direction);
    if (travel.cost() >= least) continue;
    least = travel.cost();
    R_CC0 = travel.turn();
  }
  return true;
}

void HandWave::add_images(const TrackedFrame& tracked) {
  std::vector<Vec3> before, now;
  std::size_t k = 0;  // both are in the order of their numbers
  for (const TrackedFeature& f : tracked.features) {
    while (k < last_.features.size() && last_.features[k].id < f.id) ++k;
    if (k == last_.features.size()) break;
    if (last_.features[k].id != f.id) continue;
    before.push_back(Vec3::Map(last_.features[k].bearing.data()));
    now.push_back(Vec3::Map(f.bearing.data()));
  }
  Mat3 R_CC0;
  if (turn_between(before, now, R_CC0)) {
    const double dt = (tracked.stamp - last_.stamp).seconds();
    if (dt > 0 && dt < 0.5) turns_.push_back({last_.stamp, tracked.stamp, so3_log(R_CC0.transpose()) / dt});
  }
  last_ = tracked;
}

void HandWave::add_reading(const ImuSample& reading) {
  if (readings_.size() == 2 * kReadings) readings_.erase(readings_.begin(), readings_.begin() + kReadings);
  readings_.push_back(reading);
}

HandWaveResult HandWave::result() const {
  HandWaveResult result;
  const Integral integral(readings_);
  const auto fit_at = [&](double offset_s) {
    const Span offset = Span::from_seconds(offset_s);
    std::vector<std::pair<Vec3, Vec3>> rates;  // B, C
    Vec3 mean_B = Vec3::Zero(), mean_C = Vec3::Zero();
    for (const Turn& t : turns_) {
      if (!integral.covers(t.from + offset, t.to + offset)) continue;
      const Vec3 rate_B = (integral.at(t.to + offset) - integral.at(t.from + offset)) / (t.to - t.from).seconds();
      rates.emplace_back(rate_B, t.rate_C);
      mean_B += rate_B;
      mean_C += t.rate_C;
    }
    Fit fit;
    if (rates.size() < kFewTurns) return fit;
    mean_B /= static_cast<double>(rates.size());  // the gyroscope's bias
    mean_C /= static_cast<double>(rates.size());
    Mat3 sum = Mat3::Zero();
    double squares_B = 0, squares_C = 0;
    for (const auto& [b, c] : rates) {
      sum += (b - mean_B) * (c - mean_C).transpose();
      squares_B += (b - mean_B).squaredNorm();
      squares_C += (c - mean_C).squaredNorm();
    }
    fit.R_BC = rotation_from(sum);
    fit.spread = sum.jacobiSvd().singularValues();
    fit.agreement = (fit.R_BC.transpose() * sum).trace() / std::sqrt(std::max(squares_B * squares_C, 1e-30));
    return fit;
  };
  std::size_t compared = 0;
  for (const Turn& t : turns_) {
    if (!integral.covers(t.from, t.to)) continue;  // nothing to compare with: no reading, or too many
    result.turned_s += (t.to - t.from).seconds();
    result.rate_rad_s += t.rate_C.squaredNorm();
    ++compared;
  }
  if (compared == 0) return result;
  result.rate_rad_s = std::sqrt(result.rate_rad_s / static_cast<double>(compared));
  Fit best;
  for (double offset = -kReach_s; offset <= kReach_s; offset += kStep_s) {
    const Fit fit = fit_at(offset);
    if (fit.agreement <= best.agreement) continue;
    best = fit;
    result.time_offset_s = offset;
  }
  if (best.agreement < 0) return result;
  // the top of the parabola through it and two beside, each an image or so away
  constexpr double kBeside = 0.01;
  const double left = fit_at(result.time_offset_s - kBeside).agreement;
  const double right = fit_at(result.time_offset_s + kBeside).agreement;
  const double bend = left - 2 * best.agreement + right;
  if (bend < 0) result.time_offset_s += std::clamp(0.5 * (left - right) / bend, -1., 1.) * kBeside;
  best = fit_at(result.time_offset_s);
  result.agreement = best.agreement;
  result.offset_sharpness = -bend / 2;
  result.R_BC = best.R_BC;
  result.weakest_axis = best.spread[0] > 0 ? std::sqrt(best.spread[2] / best.spread[0]) : 0;
  return result;
}

Findings findings_of(const HandWaveResult& r, const Mat3& R_BC, double time_offset_s) {
  const auto said = [](Grade grade, std::string text, std::string remedy = {}) {
    return Finding{grade, "camera and imu", std::move(text), std::move(remedy)};
  };
  constexpr const char* kWave = "turn the vehicle by hand for some seconds about all three axes, with texture in view";
  if (r.turned_s < 1 || r.rate_rad_s < 0.15)
    return {said(Grade::kWarning, "not turned: time offset and rotation not checked", kWave)};
  if (r.agreement < 0.5)
    return {said(Grade::kError, fmt::format("their rotations do not agree ({:.0f} %)", 100 * r.agreement),
                 "fix them to each other; check the lens calibration, the gyroscope's scale, and both timestamps")};
  Findings out;
  if (r.agreement < 0.8) {
    out.push_back(said(Grade::kWarning, fmt::format("their rotations agree to {:.0f} % only", 100 * r.agreement),
                       "turn more and move less; then check the jitter of the timestamps and the lens calibration"));
    return out;
  }
  const double off = r.time_offset_s - time_offset_s;
  const std::string time =
      fmt::format("time offset {:+.1f} ms (configured {:+.1f})", 1e3 * r.time_offset_s, 1e3 * time_offset_s);
  if (std::abs(off) > 0.02)
    out.push_back(said(
        Grade::kError, time,
        fmt::format("set camera.time_offset_s = {:.4f}, unless the timestamps of one are wrong", r.time_offset_s)));
  else if (std::abs(off) > 0.006)
    out.push_back(said(Grade::kWarning, time, fmt::format("set camera.time_offset_s = {:.4f}", r.time_offset_s)));
  else
    out.push_back(said(Grade::kOk, time));
  if (r.weakest_axis < 0.15) {
    out.push_back(said(Grade::kWarning, "turned about too few axes: rotation between them not checked", kWave));
    return out;
  }
  const double angle = so3_log(R_BC.transpose() * r.R_BC).norm() / kDegree;
  const std::string text = fmt::format("rotation between them is {:.1f} deg off the configured one", angle);
  if (angle > 20)
    out.push_back(said(Grade::kError, text,
                       fmt::format("axes are swapped, or T_BS is inverted: the camera looks along ({:+.2f}, {:+.2f}, "
                                   "{:+.2f}) in the IMU's axes",
                                   r.R_BC(0, 2), r.R_BC(1, 2), r.R_BC(2, 2))));
  else if (angle > 7)
    out.push_back(said(Grade::kWarning, text, "calibrate again (docs/wiring.md), as if something had moved"));
  else
    out.push_back(said(Grade::kOk, text));
  return out;
}

}  // namespace epiline
