#pragma once
#include <cstring>
#include <string>

#include "platform/error/result.h"

namespace epiline {

/// What went wrong with a device, and where. No heap: devices are reopened in the middle of a flight.
struct DeviceTrouble {
  const char* step = nullptr;  ///< nullptr: nothing went wrong
  int error = 0;               ///< errno; 0: the device did not refuse, but `found` is not what was wanted
  char found[96] = "", expected[96] = "";
  explicit operator bool() const noexcept { return step != nullptr; }
};

/// In words, for start-up. `where`: the device.
inline Error error_of(const DeviceTrouble& trouble, std::string where) {
  std::string found = trouble.step;
  if (trouble.found[0] != '\0') found.append(": ").append(trouble.found);
  if (trouble.error != 0) found.append(": ").append(std::strerror(trouble.error));
  return {ErrorKind::kRun, std::move(where), 0, std::move(found), trouble.expected};
}

}  // namespace epiline
