#pragma once
// Findings of `epiline check`: one line each, in the words of the vehicle's builder. docs/devices.md
#include <cstdint>
#include <initializer_list>
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

/// What may be wrong with something that was measured, and what to do then.
struct PossibleFault {
  bool is_there = false;
  Grade grade = Grade::kOk;
  std::string remedy;
  SettingHint hint = {};
};

/// Adds findings about one device to a list, which outlives this object.
class DeviceFindings {
 public:
  DeviceFindings(std::string device, Findings& out) : device_(std::move(device)), out_(out) {}
  void ok(std::string text) const { add(std::move(text), {}); }
  void warn(std::string text, std::string remedy) const {
    add(std::move(text), {true, Grade::kWarning, std::move(remedy)});
  }
  void error(std::string text, std::string remedy) const {
    add(std::move(text), {true, Grade::kError, std::move(remedy)});
  }
  /// Adds `text` with the first of the faults that is there; if none is, it is ok.
  void judge(std::string text, std::initializer_list<PossibleFault> faults) const;

 private:
  void add(std::string text, PossibleFault fault) const {
    out_.push_back({fault.grade, device_, std::move(text), std::move(fault.remedy), std::move(fault.hint)});
  }

  std::string device_;
  Findings& out_;
};

void add_all(Findings& out, const Findings& more);
bool has_error(const Findings& findings, const std::string& device);
/// Turns the error of opening or reading a device into a finding.
Finding of_error(const std::string& device, const Error& error);

}  // namespace epiline
