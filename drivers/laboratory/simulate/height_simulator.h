#pragma once
// The height sensors of a made-up vehicle.
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "drivers/flights/motion/motion.h"
#include "platform/samples/samples.h"

namespace epiline {

struct BarometerSimulation {
  double rate_hz = 20;
  double sigma_m = 0.1;                 ///< white
  double walk = 0.03;                   ///< of the weather, m per root of a second
  double gust_m = 0.1, gust_s = 4;      ///< error by wind: standard deviation, and how long one lasts
  double jump_m = 0, jump_at_s = 1e12;  ///< from then on all heights are off by so much
};

struct RangeSimulation {
  double rate_hz = 20;
  double sigma_m = 0.05;     ///< white
  double drop_share = 0.02;  ///< of the samples: lost
  double least_m = 0.1, most_m = 200;
  double step_m = 0, step_every_m = 50;  ///< the ground below the beam is higher by step_m on every other stretch of x
};

/// Distance to the ground from a place (W, m) along a unit vector; none: nothing is hit.
using GroundDistance = std::function<std::optional<double>(const Vec3& from, const Vec3& along)>;
/// Flat ground at this height.
GroundDistance flat_ground(double z_m);

/// Heights of the body's origin, above a level of no meaning, from `begin`, the IMU's time at the motion's time zero,
/// to the end.
std::vector<HeightSample> simulate_barometer(const MotionModel& motion, HostStamp begin,
                                             const BarometerSimulation& barometer, std::uint64_t seed);
/// Distances from the body's origin along its -z axis.
std::vector<HeightSample> simulate_range(const MotionModel& motion, HostStamp begin, const GroundDistance& ground,
                                         const RangeSimulation& range, std::uint64_t seed);

}  // namespace epiline
