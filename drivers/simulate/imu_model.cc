#include "drivers/simulate/imu_model.h"

#include <cmath>

namespace epiline {
namespace {
std::array<double, 3> clamped(const Vec3& v, double limit) {
  const Vec3 c = v.cwiseMin(limit).cwiseMax(-limit);
  return {c.x(), c.y(), c.z()};
}
}  // namespace

ImuSimulator::ImuSimulator(const ImuModel& model, const Random& random) : model_(model), random_(random) {
  b_g_ = random_.normal3(model_.gyroscope_bias_sigma);
  b_a_ = random_.normal3(model_.accelerometer_bias_sigma);
}

ImuSample ImuSimulator::read(HostStamp stamp, const Motion& motion) {
  // A density of continuous white noise, sampled over 1/rate, has the standard deviation density * sqrt(rate).
  const double white = std::sqrt(model_.rate_hz), walk = 1 / white;
  const Vec3 w =
      model_.gyroscope_matrix * motion.omega_B + b_g_ + random_.normal3(model_.noise.gyroscope_density * white);
  const Vec3 a = model_.accelerometer_matrix * motion.specific_force_B() + b_a_ +
                 random_.normal3(model_.noise.accelerometer_density * white);
  b_g_ += random_.normal3(model_.noise.gyroscope_random_walk * walk);
  b_a_ += random_.normal3(model_.noise.accelerometer_random_walk * walk);
  return {stamp, clamped(w, model_.gyroscope_limit_rad_s), clamped(a, model_.accelerometer_limit_m_s2)};
}

}  // namespace epiline
