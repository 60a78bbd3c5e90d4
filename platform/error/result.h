#pragma once
// Errors of start-up and of input are values. The path from sample to odometry uses plain enums instead: no strings
// there.
#include <string>
#include <utility>
#include <variant>

namespace epiline {

enum class ErrorKind {
  kUsage,  ///< wrong command line, configuration or input: exit code 2
  kRun,    ///< the run itself failed: exit code 1
};

/// What was found where, and what was expected. `line` 0: the whole file.
struct Error {
  ErrorKind kind = ErrorKind::kUsage;
  std::string file;
  int line = 0;
  std::string found;
  std::string expected;
  /// `FILE:LINE: found; expected`, leaving out the parts that are empty.
  std::string text() const {
    std::string s = file;
    if (line > 0) s.append(":").append(std::to_string(line));
    if (!s.empty()) s += ": ";
    s += found;
    if (!expected.empty()) s += "; expected " + expected;
    return s;
  }
};

/// A value or the error that prevented it.
template <class T>
class [[nodiscard]] Result {
 public:
  Result(T value) : v_(std::move(value)) {}      // NOLINT(google-explicit-constructor): `return value;` is the point
  Result(Error error) : v_(std::move(error)) {}  // NOLINT(google-explicit-constructor)
  explicit operator bool() const { return v_.index() == 0; }
  T& operator*() { return std::get<0>(v_); }
  const T& operator*() const { return std::get<0>(v_); }
  T* operator->() { return &std::get<0>(v_); }
  const T* operator->() const { return &std::get<0>(v_); }
  const Error& error() const { return std::get<1>(v_); }

 private:
  std::variant<T, Error> v_;
};

/// Success without a value.
struct Done {};
using Status = Result<Done>;

}  // namespace epiline
