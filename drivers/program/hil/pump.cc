#include "drivers/program/hil/pump.h"

#include <array>
#include <utility>

#include "drivers/program/hil/hardware_priority.h"

namespace epiline::hil {

namespace {
constexpr Span kWait = Span::from_milliseconds(50);
}

void Pump::start(CameraSource& camera, std::function<bool(const Frame&)> deliver) {
  running_ = true;
  thread_ = std::thread([this, &camera, deliver = std::move(deliver)] {
    const HardwarePriority priority;
    Frame frame;
    for (auto outcome = ReadOutcome::kTimeout; outcome != ReadOutcome::kEnd && !stop_;) {
      outcome = camera.read(frame, kWait);
      if (outcome != ReadOutcome::kSample) continue;
      count(deliver(frame));
      camera.give_back(frame);
    }
    running_ = false;
  });
}

void Pump::start(ImuSource& imu, std::function<bool(const ImuSample&)> deliver) {
  running_ = true;
  thread_ = std::thread([this, &imu, deliver = std::move(deliver)] {
    const HardwarePriority priority;
    std::array<ImuSample, 16> samples;
    std::size_t got = 0;
    for (auto outcome = ReadOutcome::kTimeout; outcome != ReadOutcome::kEnd && !stop_;) {
      outcome = imu.read(samples, got, kWait);
      if (outcome != ReadOutcome::kSample) continue;
      for (std::size_t i = 0; i < got; ++i) count(deliver(samples[i]));
    }
    running_ = false;
  });
}

void Pump::stop() {
  stop_ = true;
  if (thread_.joinable()) thread_.join();
}

}  // namespace epiline::hil
