#pragma once
#include <cstdint>

namespace epiline {

/// One figure of what a driver counts: its name in records and documents, and whether it should stay 0. A driver has
/// one list of them beside its counts.
template <class Counts>
struct Counter {
  const char* name;
  std::uint64_t Counts::*value;
  bool is_fault = false;
};

}  // namespace epiline
