// An IMU at rest that the kernel takes for a real one, plugged in until the program is ended.
#include <chrono>
#include <cstdio>
#include <random>
#include <thread>

#include "drivers/program/hil/uhid_imu.h"
#include "platform/time/monotonic.h"

int main() {
  epiline::UhidImu hub;
  if (const epiline::Status plugged = hub.plug_in(); !plugged) {
    std::fprintf(stderr, "%s\n", plugged.error().text().c_str());
    return 1;
  }
  std::minstd_rand random;
  std::normal_distribution<double> noise;
  const auto n = [&](double sigma) { return sigma * noise(random); };
  constexpr std::chrono::milliseconds kPeriod(10);
  for (auto next = std::chrono::steady_clock::now();; next += kPeriod) {
    std::this_thread::sleep_until(next);
    const epiline::DeviceStamp now{epiline::monotonic_ns() + 5'000'000'000};  // a clock of its own
    hub.send_accelerometer(now, {n(0.02), n(0.02), 9.81 + n(0.02)});
    hub.send_gyroscope(now, {n(2e-3), n(2e-3), n(2e-3)});
  }
}
