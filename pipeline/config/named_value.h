#pragma once
#include <cstdint>
#include <string>

namespace epiline {

/// An integer by name: a control of a device, the processor of a thread.
struct NamedValue {
  std::string name;
  std::int64_t value = 0;
};

}  // namespace epiline
