#include "drivers/laboratory/simulate/wheel_simulator.h"

#include <cmath>
#include <limits>

#include "drivers/flights/motion/random.h"

namespace epiline {

namespace {
constexpr std::uint64_t kWheelStream = 300;
}  // namespace

std::vector<WheelSample> simulate_wheel(const MotionModel& motion, HostStamp begin, const WheelSimulation& wheel,
                                        std::uint64_t seed) {
  Random random(seed, kWheelStream);
  std::vector<WheelSample> samples;
  const int count = static_cast<int>(motion.duration_s() * wheel.rate_hz) + 1;
  for (int k = 0; k < count; ++k) {
    const double t = k / wheel.rate_hz;
    const Motion m = motion.at(t);
    const double speed =
        wheel.forward_B.dot(m.R_WB.transpose() * m.v_WB) * (1 + wheel.scale_error) + random.normal() * wheel.sigma_m_s;
    const double told = wheel.step_m_s > 0 ? std::round(speed / wheel.step_m_s) * wheel.step_m_s : speed;
    samples.push_back({begin + Span::from_seconds(t), told, std::numeric_limits<double>::quiet_NaN()});
  }
  return samples;
}

}  // namespace epiline
