#pragma once
#include <fmt/format.h>

#include <iterator>
#include <string>
#include <utility>

namespace epiline {

/// Text in the making.
class Text {
 public:
  template <class... T>
  void print(fmt::format_string<T...> format, T&&... values) {
    fmt::format_to(std::back_inserter(text_), format, std::forward<T>(values)...);
  }
  operator const std::string&() const { return text_; }  // NOLINT(google-explicit-constructor)

 private:
  std::string text_;
};

}  // namespace epiline
