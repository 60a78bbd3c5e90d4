#pragma once
// Drafts a configuration from the connected devices: `epiline init`. docs/devices.md
#include <filesystem>
#include <string>
#include <vector>

#include "drivers/program/inventory/parts.h"
#include "platform/error/result.h"

namespace epiline {

struct Draft {
  std::string toml;                  ///< with the reason and the alternatives of each choice as comments
  std::vector<std::string> chosen;   ///< the choices as text, a line each
  std::vector<std::string> missing;  ///< settings that the user must add, likewise
};

/// Fails if and only if no connected device could deliver images or IMU samples.
Result<Draft> draft_configuration(const Parts& parts);

/// Fails if and only if the file exists and `replaces` is false, or it cannot be written. A replaced file is kept as
/// FILE.bak.
Status write_draft(const Draft& draft, const std::filesystem::path& file, bool replaces);

}  // namespace epiline
