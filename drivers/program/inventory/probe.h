#pragma once
// Asks what does not say by itself what it is, for `epiline init`: chips on SPI, serial ports, lines. docs/devices.md
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "drivers/program/inventory/parts.h"
#include "drivers/sensors/imu/spi_identity.h"
#include "platform/linux/system_calls.h"

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

/// The half of a BMI088 beside its gyroscope; null: none.
const ChipPart* bmi088_accelerometer(const Parts& parts);
/// Samples per second that `init` sets for a chip, and with which its line is looked for.
int usual_rate_hz(SpiChip chip);
/// As imu.driver; empty: no driver.
const char* driver_of(SpiChip chip);

/// Lines that nobody uses, and that are inputs: a line that is an output may switch something.
std::vector<std::string> free_inputs(const Parts& parts, SystemCalls& system = SystemCalls::of_this_computer());

/// Starts the chip, and counts the edges of each free input. Empty: none has the chip's rate, or more than one has.
std::string find_ready_line(const Parts& parts, const ChipPart& chip);

/// The one whose rate is within 10 % of `wanted_hz`; empty: none, or several.
struct CountedLine {
  std::string line;
  double edges_hz = 0;
};
std::string line_at_rate(const std::vector<CountedLine>& lines, double wanted_hz);

}  // namespace epiline
