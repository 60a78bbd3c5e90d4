#pragma once
// Finds the GPIO line to which a chip's interrupt pin is wired.
#include <string>
#include <vector>

#include "drivers/program/inventory/parts.h"
#include "platform/linux/system_calls.h"

namespace epiline {

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
