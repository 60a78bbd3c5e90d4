#pragma once
// What the kernel says of the computer: its name, and whether heat or a weak supply slows it down.
#include <filesystem>
#include <optional>
#include <string>

namespace epiline {

/// "Raspberry Pi 5 Model B Rev 1.0, Cortex-A76", or the processor's name alone. `root` stands for the root folder.
std::string board_name(const std::filesystem::path& root = "/");

/// What the kernel does not say is empty.
struct BoardState {
  std::optional<double> hottest_c;                  ///< of the thermal zones
  std::optional<double> clock_mhz, full_clock_mhz;  ///< of the processor that calls: now, and at most
  std::optional<unsigned long> throttled;           ///< a Raspberry Pi's flags
};
BoardState board_state(const std::filesystem::path& root = "/");

/// The flags in words.
std::string throttling_text(const std::optional<unsigned long>& flags);

}  // namespace epiline
