#pragma once
// Asks what does not say by itself what it is, for `epiline init`: chips on SPI, serial ports, lines. docs/devices.md
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "drivers/program/inventory/parts.h"
#include "drivers/sensors/imu/spi_identity.h"

namespace epiline {

/// Of a flight controller's heartbeat.
struct HeardController {
  std::uint8_t system = 1, autopilot = 0;
};

/// The ways to ask; tests replace them.
struct Probes {
  /// Of the chip at a spidev file.
  std::function<SpiChip(const std::string& device)> identity;
  /// Who is heard at this rate. `is_silent`: not one byte came.
  std::function<std::optional<HeardController>(const std::string& port, int baud, bool& is_silent)> heartbeat;
  /// The line with that many edges per second, as gpio settings name lines; empty: none, or several.
  std::function<std::string(const Parts& parts, const ChipPart& chip)> ready_line;

  static Probes of_this_computer();
};

/// Reads identity registers of the chips, listens at the board's own serial ports (those on USB have names, and opening
/// one resets some boards), and starts a chip that it knows to find its line. Writes nothing to a port.
void probe(Parts& parts, const Probes& probes);

/// Samples per second that `init` sets for a chip, and with which its line is looked for.
int usual_rate_hz(SpiChip chip);
/// As imu.driver; empty: no driver.
const char* driver_of(SpiChip chip);

}  // namespace epiline
