#pragma once
// What `epiline check` has to say: one line each, in words of who built the thing. docs/check.md
#include <cstdint>
#include <string>
#include <vector>

#include "platform/error/result.h"

namespace epiline {

enum class Grade : std::uint8_t { kOk, kWarning, kError };
inline constexpr const char* kGradeNames[] = {"ok", "warning", "error"};

/// A number in the configuration that a finding would have otherwise.
struct SettingHint {
  std::string section, key;  ///< "camera", "time_offset_s"; empty: none
  double value = 0;
};

struct Finding {
  Grade grade = Grade::kOk;
  std::string device;     ///< camera, imu, ...
  std::string text;       ///< what was found
  std::string remedy;     ///< what to do about it; empty if ok
  SettingHint hint = {};  ///< of the remedy
};
using Findings = std::vector<Finding>;

void add_all(Findings& out, const Findings& more);
bool has_error(const Findings& findings, const std::string& device);
/// What kept a device from being opened or read.
Finding of_error(const std::string& device, const Error& error);

}  // namespace epiline
