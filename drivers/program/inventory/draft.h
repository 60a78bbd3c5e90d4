#pragma once
// A configuration from what is plugged in: `epiline init`. docs/devices.md
#include <filesystem>
#include <string>
#include <vector>

#include "drivers/program/inventory/parts.h"
#include "platform/error/result.h"

namespace epiline {

struct Draft {
  std::string toml;                  ///< each choice with its reason and what else there is
  std::vector<std::string> chosen;   ///< for people, a line each
  std::vector<std::string> missing;  ///< what has to be filled in, likewise
};

/// Fails if and only if nothing is plugged in that images or IMU samples could come from.
Result<Draft> draft_configuration(const Parts& parts);

/// Fails if and only if the file is there and `replaces` is false, or it cannot be written. One that is replaced is
/// kept as FILE.bak.
Status write_draft(const Draft& draft, const std::filesystem::path& file, bool replaces);

}  // namespace epiline
