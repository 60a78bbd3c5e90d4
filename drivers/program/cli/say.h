#pragma once
// Prints for a user who may be gone: a terminal that was closed, a pipe that nobody reads or a full disk ends nothing.
#include <fmt/format.h>

#include <cstdio>
#include <string>
#include <utility>

namespace epiline {

template <class... T>
void say(std::FILE* to, fmt::format_string<T...> text, T&&... values) {
  const std::string line = fmt::format(text, std::forward<T>(values)...);
  std::fwrite(line.data(), 1, line.size(), to);
  std::fflush(to);
}
template <class... T>
void say(fmt::format_string<T...> text, T&&... values) {
  say(stdout, text, std::forward<T>(values)...);
}

}  // namespace epiline
