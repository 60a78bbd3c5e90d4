#pragma once
// An IMU at rest that the kernel takes for a real one.
#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <random>
#include <thread>

#include "drivers/program/hil/uhid_imu.h"
#include "platform/time/monotonic.h"
#include "tests/hardware/steady_thread.h"

namespace epiline {

class RestingImu {
 public:
  static constexpr double kRate_hz = 100;
  static constexpr double kGyroscopeNoise_rad_s = 2e-3, kAccelerometerNoise_m_s2 = 0.02;  ///< of each reading

  RestingImu() = default;
  ~RestingImu() {
    ends_ = true;
    if (thread_.joinable()) thread_.join();
  }
  RestingImu(const RestingImu&) = delete;
  RestingImu& operator=(const RestingImu&) = delete;

  UhidImu& hub() { return hub_; }
  /// What the accelerometer calls 1 m/s^2; before start().
  void set_unit(double unit) { unit_ = unit; }
  void start() {
    thread_ = std::thread([this] { send(); });
  }

 private:
  void send() {
    constexpr auto kPeriod_ns = static_cast<std::int64_t>(1e9 / kRate_hz);
    go_before_programs();
    std::minstd_rand random;
    std::normal_distribution<double> noise;
    const auto n = [&](double sigma) { return sigma * noise(random); };
    for (std::int64_t next_ns = monotonic_ns(); !ends_; next_ns += kPeriod_ns) {
      const std::int64_t wait_ns = next_ns - monotonic_ns();
      if (wait_ns > 0) std::this_thread::sleep_for(std::chrono::nanoseconds(wait_ns));
      const DeviceStamp now{next_ns + 5'000'000'000};  // a clock of its own, which a busy computer does not disturb
      constexpr double kA = kAccelerometerNoise_m_s2, kW = kGyroscopeNoise_rad_s;
      hub_.send_accelerometer(now, {unit_ * n(kA), unit_ * n(kA), unit_ * (9.81 + n(kA))});
      hub_.send_gyroscope(now, {n(kW), n(kW), n(kW)});
    }
  }

  UhidImu hub_;
  double unit_ = 1;
  std::atomic<bool> ends_{false};
  std::thread thread_;
};

}  // namespace epiline
