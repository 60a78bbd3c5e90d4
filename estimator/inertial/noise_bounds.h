#pragma once
// Between what limits the noise densities of an IMU lie, by its readings alone. Derivation:
// docs/derivations/imu.md#noise-densities; test: tests/estimator/inertial/noise_bounds_test.cc.
#include <array>

#include "estimator/geometry/types.h"
#include "estimator/inertial/imu_noise.h"
#include "platform/samples/samples.h"

namespace epiline {

/// The scatter of one sensor's readings in its quietest quarter of a second so far, as densities; unit/sqrt(Hz).
struct QuietestScatter {
  double fine = 0;  ///< from reading to reading; 0: unknown yet
  /// The larger of that and of means over 25 ms: filters that hide noise from the first do not from these.
  double both = 0;
};

class NoiseBounds {
 public:
  /// In time order, readings to be trusted only.
  void add(const ImuSample& reading) noexcept;
  const QuietestScatter& gyroscope() const noexcept { return sensors_[0].quietest; }
  const QuietestScatter& accelerometer() const noexcept { return sensors_[1].quietest; }
  /// Whether readings of the accelerometer or their means over 25 ms scattered, from one to the next, far more than
  /// noise of that density does, within the last second or so. What a vehicle does on its way is slower.
  bool shakes(double density) const noexcept;
  /// The configured noise with each sensor's density held between `fine` (at most that of an ordinary sensor) and
  /// the larger of 2 `fine` and 1.3 `both`; its random walk is scaled alike, or, where the density is too large, down
  /// to what belongs to half of that limit.
  ImuNoise hold(ImuNoise configured) const noexcept;

 private:
  /// Sums of squared second differences, of readings or of means.
  struct Differences {
    std::array<Vec3, 2> last;
    int known = 0, count = 0;
    double sum = 0;
    void add(const Vec3& value) noexcept;
    void restart() noexcept { known = count = 0, sum = 0; }
    /// Density of white noise that has these differences, for values `period_s` apart; 0: too few.
    double density(double period_s) const noexcept;
  };
  struct Sensor {
    Differences readings, means;
    Vec3 block = Vec3::Zero();
    QuietestScatter quietest;
    double lately = 0;  ///< the larger scatter of the last windows
  };
  void restart(HostStamp stamp) noexcept;
  void close() noexcept;

  std::array<Sensor, 2> sensors_;
  HostStamp begin_, last_;
  double period_s_ = 0;
  int readings_ = 0, in_block_ = 0, block_size_ = 0;
};

}  // namespace epiline
