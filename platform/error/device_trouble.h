#pragma once
#include <cerrno>
#include <cstring>
#include <string>

#include "platform/error/result.h"

namespace epiline {

/// What went wrong with a device, and in which step. No heap: drivers reopen lost devices during a flight.
struct DeviceTrouble {
  const char* step = nullptr;  ///< system call, setting or register; a sentence if `found` is empty. Null: no error
  int error = 0;               ///< errno; 0: the device accepted the step, but `found` is not what was expected
  char found[160] = "", expected[400] = "";
  explicit operator bool() const noexcept { return step != nullptr; }
};

/// The system refused `step`. `error`: errno, or 0 if the cause is unknown.
inline DeviceTrouble device_refusal(const char* step, int error, const char* expected = "") noexcept {
  DeviceTrouble trouble;
  trouble.step = step;
  trouble.error = error;
  std::strncpy(trouble.expected, expected, sizeof trouble.expected - 1);
  return trouble;
}

/// What was expected, for an errno that the driver has no better text for; may be empty.
inline const char* usual_remedy(int error) noexcept {
  switch (error) {
    case ENOENT:
    case ENODEV:
    case ENXIO:
      return "a connected device (epiline devices lists them)";
    case EACCES:
    case EPERM:
      return "permission: join the device's group (docs/install.md)";
    case EBUSY:
      return "a device that no other program uses";
    default:
      return "";
  }
}

/// The error for the user, at start-up: `found: errno text [step]`. `where`: name of the device.
inline Error error_of(const DeviceTrouble& trouble, std::string where) {
  std::string found = trouble.found;
  if (trouble.error != 0) found.append(found.empty() ? "" : ": ").append(std::strerror(trouble.error));
  found = found.empty() ? trouble.step : found + " [" + trouble.step + "]";
  return {ErrorKind::kRun, std::move(where), 0, std::move(found),
          trouble.expected[0] != '\0' ? trouble.expected : usual_remedy(trouble.error)};
}

}  // namespace epiline
