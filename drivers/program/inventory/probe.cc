#include "drivers/program/inventory/probe.h"

#include <fcntl.h>
#include <linux/gpio.h>
#include <poll.h>

#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <memory>

#include "drivers/links/mavlink/controller_release.h"
#include "drivers/links/mavlink/packet.h"
#include "drivers/links/mavlink/serial_port.h"
#include "drivers/sensors/gpio/gpio_line.h"
#include "drivers/sensors/imu/spi_imu_device.h"
#include "platform/time/monotonic.h"

namespace epiline {

namespace {

constexpr std::array kRates{921'600, 57'600, 115'200, 460'800, 230'400, 500'000, 1'500'000};
constexpr Span kListens = Span::from_milliseconds(1300);  // a heartbeat comes each second

/// PX4's or ArduPilot's, and of the vehicle itself.
std::optional<HeardController> controller_in(const mavlink::Packet& packet) {
  mavlink::Heartbeat heartbeat;
  const bool is_one = unpack(packet, heartbeat) && packet.from.component == 1 &&
                      (heartbeat.autopilot == mavlink::kArduPilot || heartbeat.autopilot == mavlink::kPx4);
  if (!is_one) return std::nullopt;
  return HeardController{packet.from.system, heartbeat.autopilot};
}

std::optional<HeardController> listen_at(const std::string& path, int baud, bool& is_silent) {
  mavlink::SerialPort port(path, baud);
  is_silent = true;
  if (port.open()) return std::nullopt;
  mavlink::Parser parser;
  const std::int64_t until_ns = monotonic_ns() + kListens.ns;
  for (std::int64_t now_ns = monotonic_ns(); now_ns < until_ns; now_ns = monotonic_ns()) {
    std::array<pollfd, 1> files{{{port.fd(), POLLIN, 0}}};
    SystemCalls::of_this_computer().wait(files, Span{until_ns - now_ns});
    std::array<std::uint8_t, 4096> piece;
    const mavlink::PortResult result = port.read(piece);
    if (result.is_lost) return std::nullopt;
    is_silent = is_silent && result.bytes == 0;
    std::span<const std::uint8_t> bytes(piece.data(), result.bytes);
    while (const mavlink::Packet* const packet = parser.next(bytes))
      if (const auto heard = controller_in(*packet)) return heard;
  }
  return std::nullopt;
}

void probe_port(SerialPart& port, const Probes& probes) {
  if (!port.vendor.empty() || !port.trouble.empty()) return;
  for (const int baud : kRates) {
    bool is_silent = false;
    if (const auto heard = probes.heartbeat(port.path, baud, is_silent)) {
      port.baud = baud;
      port.system = heard->system;
      port.autopilot = heard->autopilot == mavlink::kPx4 ? "PX4, by its heartbeat" : "ArduPilot, by its heartbeat";
      return;
    }
    if (is_silent) return;  // nobody sends there, at no rate
  }
}

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

}  // namespace

const ChipPart* bmi088_accelerometer(const Parts& parts) {
  for (const ChipPart& chip : parts.spi)
    if (chip.chip == SpiChip::kBmi088Accelerometer) return &chip;
  return nullptr;
}

int usual_rate_hz(SpiChip chip) { return chip == SpiChip::kIcm42688p ? 500 : 400; }

const char* driver_of(SpiChip chip) {
  if (chip == SpiChip::kIcm42688p) return "icm42688p";
  return chip == SpiChip::kUnknown ? "" : "bmi088";
}

void probe(Parts& parts, const Probes& probes) {
  for (ChipPart& chip : parts.spi)
    if (chip.trouble.empty()) chip.chip = probes.identity(chip.path);
  for (ChipPart& chip : parts.spi)
    if (chip.chip == SpiChip::kIcm42688p || chip.chip == SpiChip::kBmi088Gyroscope)
      chip.ready_line = probes.ready_line(parts, chip);
  for (SerialPart& port : parts.serial) probe_port(port, probes);
}

Probes Probes::of_this_computer() {
  return {[](const std::string& device) {
            SpidevBus bus(device);
            return ask_identity(bus);
          },
          listen_at, find_ready_line};
}

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
  const ChipPart* const other_half = bmi088_accelerometer(parts);
  if (chip.chip == SpiChip::kBmi088Gyroscope && other_half != nullptr) config.device_accel = other_half->path;
  config.rate_hz = usual_rate_hz(chip.chip);
  const std::unique_ptr<SpiImu> imu = make_spi_imu(config);
  if (imu == nullptr || !imu->open()) return "";
  std::vector<CountedLine> counted;
  for (const std::string& line : free_inputs(parts)) counted.push_back({line, edges_per_second(line, *imu)});
  imu->close();
  return line_at_rate(counted, config.rate_hz);
}

}  // namespace epiline
