#include "drivers/sensors/imu/spi_imu_device.h"

#include <utility>

#include "drivers/sensors/imu/adis16470.h"
#include "drivers/sensors/imu/bmi088.h"
#include "drivers/sensors/imu/icm42688p.h"

namespace epiline {

Status GpioDataReady::open() {
  first_ = count_ = 0;
  return line_.open();
}

ReadyOutcome GpioDataReady::wait(Span timeout, HostStamp& edge) noexcept {
  if (first_ == count_) {
    first_ = count_ = 0;
    const ReadOutcome outcome = line_.read(edges_, count_, timeout);
    if (outcome == ReadOutcome::kTimeout) return ReadyOutcome::kTimeout;
    if (outcome != ReadOutcome::kSample || count_ == 0) {
      count_ = 0;
      return ReadyOutcome::kFailed;
    }
  }
  edge = edges_[first_++];
  return ReadyOutcome::kEdge;
}

std::unique_ptr<SpiImu> make_spi_imu(const ImuDeviceConfig& config) {
  auto timing = std::make_shared<SpiTiming>();
  std::unique_ptr<ImuChip> chip;
  switch (static_cast<ImuDriver>(config.driver)) {
    case ImuDriver::kIcm42688p:
      chip = std::make_unique<Icm42688p>(config, std::make_unique<SpidevBus>(config.device), *timing);
      break;
    case ImuDriver::kBmi088:
      chip = std::make_unique<Bmi088>(config, std::make_unique<SpidevBus>(config.device),
                                      std::make_unique<SpidevBus>(config.device_accel), *timing);
      break;
    case ImuDriver::kAdis16470:
      chip = std::make_unique<Adis16470>(config, std::make_unique<SpidevBus>(config.device), *timing);
      break;
    default:
      return nullptr;
  }
  std::unique_ptr<DataReady> ready;
  if (!config.ready_line.empty())
    ready = std::make_unique<GpioDataReady>(config.ready_line, static_cast<Edge>(config.ready_edge));
  return std::make_unique<SpiImu>(config, std::move(chip), std::move(ready), std::move(timing));
}

}  // namespace epiline
