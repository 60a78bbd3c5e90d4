#include "estimator/inertial/noise_bounds.h"

#include <algorithm>
#include <cmath>

namespace epiline {

namespace {
constexpr double kWindow_s = 0.25, kBlock_s = 0.025;
constexpr int kFewest = 6;  // second differences
// rad/s/sqrt(Hz), m/s^2/sqrt(Hz): of ordinary sensors (150 ug, 0.01 deg/s). What vibration adds to the readings is
// motion, well measured: it must not widen a density beyond that.
constexpr double kUsualGyroscope = 1.7e-4, kUsualAccelerometer = 2e-3;
constexpr double kLoosest = 2, kLoosestFiltered = 1.3;  // users widen densities on purpose; against `fine`, `both`
constexpr double kIrregular = 1.6;                      // periods: readings are missing
constexpr double kShakes = 2;                           // times the density of a quiet sensor
constexpr double kFading = 0.7;                         // in each window: shaking lasts for a second after its end
}  // namespace

void NoiseBounds::Differences::add(const Vec3& value) noexcept {
  if (known >= 2) {
    sum += (value - 2 * last[1] + last[0]).squaredNorm();
    ++count;
  }
  last[0] = last[1];
  last[1] = value;
  known = std::min(known + 1, 2);
}

/// A second difference of white noise has six times its variance.
double NoiseBounds::Differences::density(double period_s) const noexcept {
  return count >= kFewest ? std::sqrt(sum / (3. * count) / 6 * period_s) : 0;
}

void NoiseBounds::restart(HostStamp stamp) noexcept {
  begin_ = stamp;
  readings_ = in_block_ = 0;
  for (Sensor& s : sensors_) {
    s.readings.restart();
    s.means.restart();
    s.block.setZero();
  }
}

void NoiseBounds::add(const ImuSample& reading) noexcept {
  const double dt_s = (reading.stamp - last_).seconds();
  if (last_.ns == 0 || !(dt_s > 0) || (period_s_ > 0 && dt_s > kIrregular * period_s_)) {
    if (last_.ns != 0 && dt_s > 0 && readings_ < 3) period_s_ = dt_s;  // slower than believed
    restart(reading.stamp);
  }
  last_ = reading.stamp;
  const std::array<Vec3, 2> values = {Vec3::Map(reading.angular_velocity_rad_s.data()),
                                      Vec3::Map(reading.specific_force_m_s2.data())};
  for (std::size_t i = 0; i < 2; ++i) {
    sensors_[i].readings.add(values[i]);
    sensors_[i].block += values[i];
  }
  ++readings_;
  ++in_block_;
  if (block_size_ > 0 && in_block_ == block_size_) {
    for (Sensor& s : sensors_) {
      s.means.add(s.block / in_block_);
      s.block.setZero();
    }
    in_block_ = 0;
  }
  if ((reading.stamp - begin_).seconds() >= kWindow_s) {
    close();
    restart(reading.stamp);
  }
}

/// The window is complete.
void NoiseBounds::close() noexcept {
  if (readings_ < 3) return;
  period_s_ = (last_ - begin_).seconds() / (readings_ - 1);
  for (Sensor& s : sensors_) {
    const double fine = s.readings.density(period_s_);
    const double both = std::max(fine, s.means.density(period_s_ * block_size_));
    s.lately = std::max(both, kFading * s.lately);
    if (fine > 0 && (s.quietest.fine == 0 || fine < s.quietest.fine)) s.quietest.fine = fine;
    if (both > 0 && block_size_ > 0 && (s.quietest.both == 0 || both < s.quietest.both)) s.quietest.both = both;
  }
  block_size_ = std::max(1, static_cast<int>(std::lround(kBlock_s / period_s_)));
}

bool NoiseBounds::shakes(double density) const noexcept { return sensors_[1].lately > kShakes * density; }

ImuNoise NoiseBounds::hold(ImuNoise configured) const noexcept {
  const auto hold_one = [](const QuietestScatter& seen, double usual, double& density, double& walk) {
    if (seen.both > 0) {
      // the walk falls to what belongs to the readings themselves, whose density is 1 / kLoosest of the limit
      const double share = std::min(1.0, std::max(kLoosest * seen.fine, kLoosestFiltered * seen.both) / density);
      density *= share;
      walk *= std::max(share * share, share / kLoosest);
    }
    const double least = std::min(seen.fine, usual);
    if (density < least) {
      walk *= least / density;
      density = least;
    }
  };
  hold_one(gyroscope(), kUsualGyroscope, configured.gyroscope_density, configured.gyroscope_random_walk);
  hold_one(accelerometer(), kUsualAccelerometer, configured.accelerometer_density,
           configured.accelerometer_random_walk);
  return configured;
}

}  // namespace epiline
