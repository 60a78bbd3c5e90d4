#include "drivers/program/inventory/probe.h"

#include <fcntl.h>
#include <linux/gpio.h>
#include <poll.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <memory>

#include "drivers/links/mavlink/packet.h"
#include "drivers/links/mavlink/serial_port.h"
#include "drivers/program/inventory/ready_line.h"
#include "platform/time/monotonic.h"

namespace epiline {

namespace {

constexpr std::array kRates{921'600, 57'600, 115'200, 460'800, 230'400, 500'000, 1'500'000};
constexpr Span kListens = Span::from_milliseconds(1300);  // a heartbeat comes each second

/// PX4's or ArduPilot's, and of the vehicle itself.
std::optional<HeardController> controller_in(const mavlink::Packet& packet) {
  constexpr std::uint8_t kArduPilot = 3, kPx4 = 12;
  mavlink::Heartbeat heartbeat;
  const bool is_one = unpack(packet, heartbeat) && packet.from.component == 1 &&
                      (heartbeat.autopilot == kArduPilot || heartbeat.autopilot == kPx4);
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
      port.autopilot = heard->autopilot == 12 ? "PX4, by its heartbeat" : "ArduPilot, by its heartbeat";
      return;
    }
    if (is_silent) return;  // nobody sends there, at no rate
  }
}

}  // namespace

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

}  // namespace epiline
