#pragma once
// The IMU on an SPI bus that a configuration asks for.
#include <array>
#include <memory>

#include "drivers/sensors/gpio/gpio_line.h"
#include "drivers/sensors/imu/spi_imu.h"

namespace epiline {

/// A GPIO line as data-ready line.
class GpioDataReady final : public DataReady {
 public:
  GpioDataReady(std::string line, Edge edge) : line_(std::move(line), edge) {}
  Status open() override;
  void close() noexcept override { line_.close(); }
  ReadyOutcome wait(Span timeout, HostStamp& edge) noexcept override;

 private:
  GpioLine line_;
  std::array<HostStamp, 32> edges_{};
  std::size_t first_ = 0, count_ = 0;
};

/// Not open yet. nullptr: `config.driver` is no chip on an SPI bus. Errors come from open().
std::unique_ptr<SpiImu> make_spi_imu(const ImuDeviceConfig& config);

}  // namespace epiline
