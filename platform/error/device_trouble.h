#pragma once
#include <cerrno>
#include <cstring>
#include <string>

#include "platform/error/result.h"

namespace epiline {

/// What went wrong with a device, and where. No heap: devices are reopened in the middle of a flight.
struct DeviceTrouble {
  const char* step = nullptr;  ///< nullptr: nothing went wrong
  int error = 0;               ///< errno; 0: the device did not refuse, but `found` is not what was wanted
  char found[160] = "", expected[400] = "";
  explicit operator bool() const noexcept { return step != nullptr; }
};

/// The system said no. `error`: errno; 0: it did not say why.
inline DeviceTrouble device_refusal(const char* step, int error, const char* expected = "") noexcept {
  DeviceTrouble trouble;
  trouble.step = step;
  trouble.error = error;
  std::strncpy(trouble.expected, expected, sizeof trouble.expected - 1);
  return trouble;
}

/// What a builder would have to see to, where the driver knows nothing better to say; may be empty.
inline const char* usual_remedy(int error) noexcept {
  switch (error) {
    case ENOENT:
    case ENODEV:
    case ENXIO:
      return "a device that is there (epiline check lists them)";
    case EACCES:
    case EPERM:
      return "a device this user may open (groups: docs/install.md)";
    case EBUSY:
      return "a device that no other program uses";
    default:
      return "";
  }
}

/// In words, for start-up. `where`: the device.
inline Error error_of(const DeviceTrouble& trouble, std::string where) {
  std::string found = trouble.step;
  if (trouble.found[0] != '\0') found.append(": ").append(trouble.found);
  if (trouble.error != 0) found.append(": ").append(std::strerror(trouble.error));
  return {ErrorKind::kRun, std::move(where), 0, std::move(found),
          trouble.expected[0] != '\0' ? trouble.expected : usual_remedy(trouble.error)};
}

}  // namespace epiline
