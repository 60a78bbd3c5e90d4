#pragma once
// How drivers say what went wrong with a device.
#include <cstdarg>
#include <cstdio>

#include "platform/error/device_trouble.h"

namespace epiline {

/// The system answered `step` with this errno; 0: no trouble.
inline DeviceTrouble refused(const char* step, int error) noexcept {
  return error != 0 ? device_refusal(step, error) : DeviceTrouble{};
}

/// The step worked, but `format`, as of printf(), is what was found.
[[gnu::format(printf, 3, 4)]] inline DeviceTrouble unexpected(const char* step, const char* expected,
                                                              const char* format, ...) noexcept {
  DeviceTrouble trouble = device_refusal(step, 0, expected);
  std::va_list found;
  va_start(found, format);
  std::vsnprintf(trouble.found, sizeof(trouble.found), format, found);
  va_end(found);
  return trouble;
}

/// The same trouble, with what was expected.
[[gnu::format(printf, 2, 3)]] inline DeviceTrouble expecting(DeviceTrouble trouble, const char* format, ...) noexcept {
  std::va_list expected;
  va_start(expected, format);
  std::vsnprintf(trouble.expected, sizeof(trouble.expected), format, expected);
  va_end(expected);
  return trouble;
}

}  // namespace epiline
