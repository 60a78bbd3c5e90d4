#pragma once
// How the files of a camera say what went wrong with a call.
#include <cstdarg>
#include <cstdio>

#include "platform/error/device_trouble.h"

namespace epiline {

inline DeviceTrouble refused(const char* step, int error) noexcept {
  DeviceTrouble trouble;
  if (error == 0) return trouble;
  trouble.step = step;
  trouble.error = error;
  return trouble;
}

[[gnu::format(printf, 3, 4)]] inline DeviceTrouble unexpected(const char* step, const char* expected,
                                                              const char* format, ...) noexcept {
  DeviceTrouble trouble;
  trouble.step = step;
  std::va_list found;
  va_start(found, format);
  std::vsnprintf(trouble.found, sizeof(trouble.found), format, found);
  va_end(found);
  std::snprintf(trouble.expected, sizeof(trouble.expected), "%s", expected);
  return trouble;
}

}  // namespace epiline
