#pragma once
#include <string>

namespace epiline {

/// Which program this is.
struct ProgramInfo {
  std::string version, commit, compiler, build_type, simd;
};
ProgramInfo program_info();

}  // namespace epiline
