#include "drivers/program/check/finding.h"

#include <algorithm>

namespace epiline {

void DeviceFindings::judge(std::string text, std::initializer_list<PossibleFault> faults) const {
  const auto* const first =
      std::find_if(faults.begin(), faults.end(), [](const PossibleFault& f) { return f.is_there; });
  add(std::move(text), first == faults.end() ? PossibleFault() : *first);
}

void add_all(Findings& out, const Findings& more) { out.insert(out.end(), more.begin(), more.end()); }

bool has_error(const Findings& findings, const std::string& device) {
  return std::any_of(findings.begin(), findings.end(),
                     [&](const Finding& f) { return f.grade == Grade::kError && f.device == device; });
}

Finding of_error(const std::string& device, const Error& error) {
  const Error plain{error.kind, error.file, error.line, error.found, ""};
  return {Grade::kError, device, plain.text(), error.expected.empty() ? "" : "expected " + error.expected};
}

}  // namespace epiline
