#pragma once
// The wheels of a made-up vehicle, which looks along the body's x axis.
#include <cstdint>
#include <vector>

#include "drivers/flights/motion/motion.h"
#include "platform/samples/samples.h"

namespace epiline {

struct WheelSimulation {
  double rate_hz = 50;
  double sigma_m_s = 0.02;         ///< white
  double step_m_s = 0.01;          ///< reported speeds are multiples of it
  Vec3 forward_B = Vec3::UnitX();  ///< of the vehicle
  double scale_error = 0;          ///< of the wheels' radius: with 0.01, speeds are 1 % too high
};

/// Forward speeds of the body's origin from `begin`, the IMU's time at the motion's time zero, to the end.
std::vector<WheelSample> simulate_wheel(const MotionModel& motion, HostStamp begin, const WheelSimulation& wheel,
                                        std::uint64_t seed);

}  // namespace epiline
