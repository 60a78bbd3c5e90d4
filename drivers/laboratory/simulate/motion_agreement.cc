#include "drivers/laboratory/simulate/motion_agreement.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "estimator/geometry/so3.h"
#include "platform/math/statistics.h"

namespace epiline {
namespace {

using Vec9 = Eigen::Matrix<double, 9, 1>;
using Mat9 = Eigen::Matrix<double, 9, 9>;

bool inside(const FittedMotion& motion, const ImuSample& s) {
  const double t = motion.seconds(s.stamp);
  return t >= 0 && t <= motion.duration_s();
}

/// Preintegrates the readings from the first to the last.
Preintegration integrated(const ImuSample* first, const ImuSample* last, const Vec3& b_a, const Vec3& b_g,
                          const ImuNoise& noise) {
  Preintegration piece;
  piece.reset(b_a, b_g);
  for (; first != last; ++first) {
    const ImuSample& next = *(first + 1);
    piece.integrate(vec3(first->angular_velocity_rad_s), vec3(first->specific_force_m_s2),
                    vec3(next.angular_velocity_rad_s), vec3(next.specific_force_m_s2),
                    (next.stamp - first->stamp).seconds(), noise);
  }
  return piece;
}

/// What the motion does beyond the integrated readings: position, rotation, velocity, as in the IMU factor.
Vec9 deviation(const Preintegration& piece, const Motion& a, const Motion& b) {
  const double T = piece.T;
  Vec9 e;
  e.head<3>() = a.R_WB.transpose() * (b.p_WB - a.p_WB - T * a.v_WB - 0.5 * T * T * kGravity_W) - piece.dp;
  e.segment<3>(3) = so3_log(piece.dR.transpose() * a.R_WB.transpose() * b.R_WB);
  e.tail<3>() = a.R_WB.transpose() * (b.v_WB - a.v_WB - T * kGravity_W) - piece.dv;
  return e;
}

}  // namespace

SampleAgreement sample_agreement(const FittedMotion& motion, const std::vector<ImuSample>& imu, const ImuNoise& noise) {
  std::vector<double> w, a;
  double seconds = 0;
  HostStamp last{};
  for (const ImuSample& s : imu) {
    if (!inside(motion, s)) continue;
    if (!w.empty()) seconds += (s.stamp - last).seconds();
    last = s.stamp;
    const double t = motion.seconds(s.stamp);
    const Motion m = motion.at(t);
    const Vec3 e_w = vec3(s.angular_velocity_rad_s) - motion.gyroscope_bias(t) - m.omega_B;
    const Vec3 e_a = vec3(s.specific_force_m_s2) - motion.accelerometer_bias(t) - m.specific_force_B();
    for (int k = 0; k < 3; ++k) {
      w.push_back(std::abs(e_w[k]));
      a.push_back(std::abs(e_a[k]));
    }
  }
  SampleAgreement result;
  if (w.size() < 6 || !(seconds > 0)) return result;
  const double white = std::sqrt((static_cast<double>(w.size()) / 3 - 1) / seconds);
  const Summary gyroscope = summarise(std::move(w)), accelerometer = summarise(std::move(a));
  result.gyroscope = {gyroscope.rmse, noise.gyroscope_density * white};
  result.accelerometer = {accelerometer.rmse, noise.accelerometer_density * white};
  result.gyroscope_p95 = gyroscope.p95;
  result.accelerometer_p95 = accelerometer.p95;
  return result;
}

IntegratedAgreement integrated_agreement(const FittedMotion& motion, const std::vector<ImuSample>& imu,
                                         const ImuNoise& noise, double interval_s) {
  IntegratedAgreement result;
  result.interval_s = interval_s;
  Vec9 squares = Vec9::Zero(), variances = Vec9::Zero();
  const ImuSample* const end = imu.data() + imu.size();
  const ImuSample* first = std::find_if(imu.data(), end, [&](const ImuSample& s) { return inside(motion, s); });
  while (first != end) {
    const HostStamp stop = first->stamp + Span::from_seconds(interval_s - 1e-4);
    const ImuSample* last = std::find_if(first, end, [&](const ImuSample& s) { return s.stamp >= stop; });
    if (last == end || !inside(motion, *last)) break;
    const double t = motion.seconds(first->stamp);
    const Preintegration piece = integrated(first, last, motion.accelerometer_bias(t), motion.gyroscope_bias(t), noise);
    const Vec9 e = deviation(piece, motion.at(t), motion.at(motion.seconds(last->stamp)));
    const Mat9 C = piece.C.topLeftCorner<9, 9>();
    squares += e.cwiseAbs2();
    variances += C.diagonal();
    result.nees += e.dot(C.ldlt().solve(e)) / 9;
    const auto part = [&](int at) {
      const Vec3 e_part = e.segment<3>(at);
      return e_part.dot(C.block<3, 3>(at, at).ldlt().solve(e_part)) / 3;
    };
    result.nees_position += part(0);
    result.nees_rotation += part(3);
    result.nees_velocity += part(6);
    ++result.count;
    first = last;
  }
  if (result.count == 0) return result;
  const double n = result.count;
  for (double* nees : {&result.nees, &result.nees_position, &result.nees_rotation, &result.nees_velocity}) *nees /= n;
  const auto agreement = [&](int at) {
    return Agreement{std::sqrt(squares.segment<3>(at).sum() / (3 * n)),
                     std::sqrt(variances.segment<3>(at).sum() / (3 * n))};
  };
  result.position = agreement(0);
  result.rotation = agreement(3);
  result.velocity = agreement(6);
  return result;
}

}  // namespace epiline
