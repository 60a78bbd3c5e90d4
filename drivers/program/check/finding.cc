#include "drivers/program/check/finding.h"

#include <algorithm>

namespace epiline {

bool has_error(const Findings& findings, const std::string& device) {
  return std::any_of(findings.begin(), findings.end(),
                     [&](const Finding& f) { return f.grade == Grade::kError && f.device == device; });
}

void add_all(Findings& out, const Findings& more) { out.insert(out.end(), more.begin(), more.end()); }

Finding of_error(const std::string& device, const Error& error) {
  const Error plain{error.kind, error.file, error.line, error.found, ""};
  return {Grade::kError, device, plain.text(), error.expected.empty() ? "" : "expected " + error.expected};
}

}  // namespace epiline
