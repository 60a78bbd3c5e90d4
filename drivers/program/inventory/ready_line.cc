#include "drivers/program/inventory/ready_line.h"

#include <fcntl.h>
#include <linux/gpio.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <memory>

#include "drivers/program/inventory/probe.h"
#include "drivers/sensors/gpio/gpio_line.h"
#include "drivers/sensors/imu/spi_imu_device.h"
#include "platform/time/monotonic.h"

namespace epiline {

namespace {

constexpr Span kCounts = Span::from_milliseconds(100), kReads = Span::from_milliseconds(5);  // 40 edges at 400 Hz

/// Meanwhile the chip is read, as some give no edge before that.
double edges_per_second(const std::string& name, SpiImu& imu) {
  GpioLine line(name, Edge::kRising);
  if (!line.open()) return 0;
  std::array<HostStamp, 64> edges;
  std::array<ImuSample, 64> samples;
  std::size_t all = 0;
  HostStamp first, last;
  for (const std::int64_t until_ns = monotonic_ns() + kCounts.ns; monotonic_ns() < until_ns;) {
    std::size_t count = 0, samples_count = 0;
    imu.read(samples, samples_count, kReads);
    if (line.read(edges, count, Span{}) == ReadOutcome::kFailed) break;
    if (all == 0 && count > 0) first = edges[0];
    if (count > 0) last = edges[count - 1];
    all += count;
  }
  const double span_s = (last - first).seconds();
  return all > 2 && span_s > 0.5 * kCounts.seconds() ? static_cast<double>(all - 1) / span_s : 0;
}

/// Of a BMI088, the other half.
std::string accelerometer_of(const Parts& parts, const ChipPart& chip) {
  if (chip.chip != SpiChip::kBmi088Gyroscope) return "";
  for (const ChipPart& other : parts.spi)
    if (other.chip == SpiChip::kBmi088Accelerometer) return other.path;
  return "";
}

}  // namespace

std::vector<std::string> free_inputs(const Parts& parts, SystemCalls& system) {
  std::vector<std::string> lines;
  for (const GpioPart& chip : parts.gpio) {
    const int fd = chip.trouble.empty() ? system.open(chip.path.c_str(), O_RDWR) : -1;
    if (fd < 0) continue;
    for (unsigned offset = 0; offset < chip.lines; ++offset) {
      gpio_v2_line_info info{};
      info.offset = offset;
      if (system.ioctl(fd, GPIO_V2_GET_LINEINFO_IOCTL, &info) != 0) break;
      if ((info.flags & GPIO_V2_LINE_FLAG_USED) != 0 || (info.flags & GPIO_V2_LINE_FLAG_INPUT) == 0) continue;
      const std::string name(info.name, ::strnlen(info.name, sizeof info.name));
      const std::string of_chip = chip.name.empty() ? std::filesystem::path(chip.path).filename().string() : chip.name;
      lines.push_back(name.empty() || name == "-" ? of_chip + ":" + std::to_string(offset) : name);
    }
    system.close(fd);
  }
  return lines;
}

std::string line_at_rate(const std::vector<CountedLine>& lines, double wanted_hz) {
  constexpr double kTolerance = 0.1;  // chips are 5 % off at most
  std::string found;
  for (const CountedLine& line : lines) {
    if (std::abs(line.edges_hz / wanted_hz - 1) > kTolerance) continue;
    if (!found.empty()) return "";
    found = line.line;
  }
  return found;
}

std::string find_ready_line(const Parts& parts, const ChipPart& chip) {
  ImuDeviceConfig config;
  config.driver = static_cast<int>(chip.chip == SpiChip::kIcm42688p ? ImuDriver::kIcm42688p : ImuDriver::kBmi088);
  config.device = chip.path;
  config.device_accel = accelerometer_of(parts, chip);
  config.rate_hz = usual_rate_hz(chip.chip);
  const std::unique_ptr<SpiImu> imu = make_spi_imu(config);
  if (imu == nullptr || !imu->open()) return "";
  std::vector<CountedLine> counted;
  for (const std::string& line : free_inputs(parts)) counted.push_back({line, edges_per_second(line, *imu)});
  imu->close();
  return line_at_rate(counted, config.rate_hz);
}

}  // namespace epiline
