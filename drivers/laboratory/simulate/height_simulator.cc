#include "drivers/laboratory/simulate/height_simulator.h"

#include <cmath>

#include "drivers/flights/motion/random.h"

namespace epiline {

namespace {
constexpr std::uint64_t kBarometerStream = 310, kRangeStream = 311;

int samples_of(const MotionModel& motion, double rate_hz) {
  return static_cast<int>(motion.duration_s() * rate_hz) + 1;
}
}  // namespace

GroundDistance flat_ground(double z_m) {
  return [z_m](const Vec3& from, const Vec3& along) -> std::optional<double> {
    if (!(along.z() < 0)) return std::nullopt;
    return (z_m - from.z()) / along.z();
  };
}

std::vector<HeightSample> simulate_barometer(const MotionModel& motion, HostStamp begin,
                                             const BarometerSimulation& barometer, std::uint64_t seed) {
  Random random(seed, kBarometerStream);
  const double interval_s = 1 / barometer.rate_hz, kept = std::exp(-interval_s / barometer.gust_s);
  double weather = random.uniform(0, 100), gust = barometer.gust_m * random.normal();
  std::vector<HeightSample> samples;
  for (int k = 0; k < samples_of(motion, barometer.rate_hz); ++k) {
    const double t = k * interval_s;
    const double jump = t >= barometer.jump_at_s ? barometer.jump_m : 0;
    const double height = motion.at(t).p_WB.z() + weather + gust + jump + barometer.sigma_m * random.normal();
    samples.push_back({begin + Span::from_seconds(t), HeightKind::kBarometer, height});
    weather += barometer.walk * std::sqrt(interval_s) * random.normal();
    gust = kept * gust + std::sqrt(1 - kept * kept) * barometer.gust_m * random.normal();
  }
  return samples;
}

std::vector<HeightSample> simulate_range(const MotionModel& motion, HostStamp begin, const GroundDistance& ground,
                                         const RangeSimulation& range, std::uint64_t seed) {
  Random random(seed, kRangeStream);
  std::vector<HeightSample> samples;
  for (int k = 0; k < samples_of(motion, range.rate_hz); ++k) {
    const double t = k / range.rate_hz, noise = range.sigma_m * random.normal();
    const bool is_lost = random.chance(range.drop_share);
    const Motion m = motion.at(t);
    const Vec3 beam = m.R_WB * -Vec3::UnitZ();
    const bool is_raised = static_cast<std::int64_t>(std::floor(m.p_WB.x() / range.step_every_m)) % 2 != 0;
    const auto distance = ground(m.p_WB - (is_raised ? range.step_m : 0) * Vec3::UnitZ(), beam);
    if (is_lost || !distance) continue;
    const double told = *distance + noise;
    if (told < range.least_m || told > range.most_m) continue;
    samples.push_back({begin + Span::from_seconds(t), HeightKind::kRangeFinder, told});
  }
  return samples;
}

}  // namespace epiline
