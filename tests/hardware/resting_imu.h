#pragma once
// An IMU at rest that the kernel takes for a real one.
#include <memory>
#include <random>

#include "drivers/program/hil/uhid_imu.h"
#include "tests/hardware/support.h"

namespace epiline {

class RestingImu {
 public:
  static constexpr double kRate_hz = 100;
  static constexpr double kGyroscopeNoise_rad_s = 2e-3, kAccelerometerNoise_m_s2 = 0.02;  ///< of each reading

  UhidImu& hub() { return hub_; }
  /// `unit`: what the accelerometer calls 1 m/s^2.
  void start(double unit = 1) {
    readings_ = std::make_unique<Again>(kRate_hz, [this, unit](std::int64_t at_ns) {
      const auto n = [&](double sigma) { return sigma * noise_(random_); };
      const DeviceStamp now{at_ns + 5'000'000'000};  // a clock of its own, which a busy computer does not disturb
      constexpr double kA = kAccelerometerNoise_m_s2, kW = kGyroscopeNoise_rad_s;
      hub_.send_accelerometer(now, {unit * n(kA), unit * n(kA), unit * (9.81 + n(kA))});
      hub_.send_gyroscope(now, {n(kW), n(kW), n(kW)});
    });
  }

 private:
  UhidImu hub_;
  std::minstd_rand random_;
  std::normal_distribution<double> noise_;
  std::unique_ptr<Again> readings_;  ///< ends before what it uses
};

}  // namespace epiline
