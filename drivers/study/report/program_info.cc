#include "drivers/study/report/program_info.h"

#include "epiline_commit.h"
#include "pipeline/vision/klt.h"

namespace epiline {

ProgramInfo program_info() {
#if defined(__clang__)
  const std::string compiler = "clang " __clang_version__;
#else
  const std::string compiler = "gcc " __VERSION__;
#endif
  return {EPILINE_VERSION, EPILINE_COMMIT, compiler, EPILINE_BUILD_TYPE, simd_target()};
}

}  // namespace epiline
