#include "drivers/laboratory/simulate/imu_model.h"

#include <cmath>
#include <numbers>

namespace epiline {
namespace {
std::array<double, 3> clamped(const Vec3& v, double limit) {
  const Vec3 c = v.cwiseMin(limit).cwiseMax(-limit);
  return {c.x(), c.y(), c.z()};
}
}  // namespace

Mat3 random_axes(double scale_sigma, double misalignment_sigma_rad, Random& random) {
  Mat3 M = Mat3::Identity();
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) M(i, j) += (i == j ? scale_sigma : misalignment_sigma_rad) * random.normal();
  return M;
}

ImuModel imu_model_with(const ImuEffects& effects, const ImuNoise& noise, double rate_hz, Random random) {
  ImuModel model;
  model.rate_hz = rate_hz;
  model.noise = noise;
  model.noise.gyroscope_density *= effects.noise_factor;
  model.noise.accelerometer_density *= effects.noise_factor;
  model.noise.gyroscope_random_walk *= effects.noise_factor;
  model.noise.accelerometer_random_walk *= effects.noise_factor;
  model.gyroscope_bias_sigma *= effects.bias_factor;
  model.accelerometer_bias_sigma *= effects.bias_factor;
  model.gyroscope_matrix = random_axes(effects.scale_sigma, effects.misalignment_sigma_rad, random);
  model.accelerometer_matrix = random_axes(effects.scale_sigma, effects.misalignment_sigma_rad, random);
  model.gyroscope_limit_rad_s = effects.gyroscope_limit_rad_s;
  model.accelerometer_limit_m_s2 = effects.accelerometer_limit_m_s2;
  if (effects.vibration_hz > 0) {
    model.vibrations.push_back({.frequency_hz = effects.vibration_hz,
                                .acceleration_m_s2 = 2,
                                .rate_rad_s = 0.02,
                                .axis = random.normal3(1).normalized(),
                                .phase_rad = 0});
  }
  return model;
}

ImuSimulator::ImuSimulator(const ImuModel& model, const Random& random) : model_(model), random_(random) {
  b_g_ = random_.normal3(model_.gyroscope_bias_sigma);
  b_a_ = random_.normal3(model_.accelerometer_bias_sigma);
}

ImuSample ImuSimulator::read(HostStamp stamp, const Motion& motion) {
  // A density of continuous white noise, sampled over 1/rate, has the standard deviation density * sqrt(rate).
  const double white = std::sqrt(model_.rate_hz), walk = 1 / white;
  Vec3 w = model_.gyroscope_matrix * motion.omega_B + b_g_ + random_.normal3(model_.noise.gyroscope_density * white);
  Vec3 a = model_.accelerometer_matrix * motion.specific_force_B() + b_a_ +
           random_.normal3(model_.noise.accelerometer_density * white);
  if (!first_) first_ = stamp;
  for (const VibrationLine& line : model_.vibrations) {
    const double turns = line.frequency_hz * (stamp - *first_).seconds();
    const double wave = std::sin(2 * std::numbers::pi * turns + line.phase_rad);
    w += line.rate_rad_s * wave * line.axis;
    a += line.acceleration_m_s2 * wave * line.axis;
  }
  b_g_ += random_.normal3(model_.noise.gyroscope_random_walk * walk);
  b_a_ += random_.normal3(model_.noise.accelerometer_random_walk * walk);
  return {stamp, clamped(w, model_.gyroscope_limit_rad_s), clamped(a, model_.accelerometer_limit_m_s2)};
}

}  // namespace epiline
