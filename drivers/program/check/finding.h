#pragma once
// Findings of `epiline check`: one line each, in the words of the vehicle's builder. docs/devices.md
#include <cstdint>
#include <string>
#include <vector>

#include "platform/error/result.h"

namespace epiline {

enum class Grade : std::uint8_t { kOk, kWarning, kError };
inline constexpr const char* kGradeNames[] = {"ok", "warning", "error"};

/// A number that a finding proposes for a setting of the configuration.
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
/// Turns the error of opening or reading a device into a finding.
Finding of_error(const std::string& device, const Error& error);

}  // namespace epiline
