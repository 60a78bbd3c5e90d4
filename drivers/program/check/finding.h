#pragma once
// What `epiline check` has to say: one line each, in words of who built the thing. docs/check.md
#include <cstdint>
#include <string>
#include <vector>

namespace epiline {

enum class Grade : std::uint8_t { kOk, kWarning, kError };
inline constexpr const char* kGradeNames[] = {"ok", "warning", "error"};

struct Finding {
  Grade grade = Grade::kOk;
  std::string device;  ///< camera, imu, ...
  std::string text;    ///< what was found
  std::string remedy;  ///< what to do about it; empty if ok
};
using Findings = std::vector<Finding>;

}  // namespace epiline
